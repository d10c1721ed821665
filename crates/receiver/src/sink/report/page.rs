//! The page around the drawings.

use std::fmt::Write as _;

use super::Report;
use super::chart::{Chart, Line, Mark};
use super::series::Series;
use super::sky::{SkyTrack, ground_plot, sky_plot};
use crate::summary::Summary;

const STYLE: &str = "\
:root{--ink:#1c2733;--soft:#5d6b7a;--paper:#f5f7fa;--card:#fff;--rule:#dfe5ec;--accent:#1f6fd6;--alarm:#c6362c}
@media(prefers-color-scheme:dark){:root{--ink:#e6ebf1;--soft:#97a5b4;--paper:#11161c;--card:#1a2129;--rule:#2c3641;--accent:#62a3ff;--alarm:#ff7a70}}
body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,'Segoe UI',Helvetica,Arial,sans-serif}
main{max-width:1000px;margin:0 auto;padding:28px 20px 60px}
h1{font-size:24px;margin:0 0 2px;overflow-wrap:anywhere}h2{font-size:16px;margin:0 0 10px}
p.sub{color:var(--soft);margin:0 0 20px}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(168px,1fr));gap:12px;margin-bottom:16px}
.tile,.card{background:var(--card);border:1px solid var(--rule);border-radius:10px;padding:14px 16px}
.card{margin-bottom:16px;overflow-x:auto}
.tile b{display:block;font-size:19px;font-weight:600;font-variant-numeric:tabular-nums}
.tile span{color:var(--soft);font-size:13px}
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(330px,1fr));gap:16px}
.warn{border-color:var(--alarm);color:var(--alarm)}
table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums;font-size:14px}
th,td{text-align:right;padding:4px 10px;border-bottom:1px solid var(--rule)}th{color:var(--soft);font-weight:500}
th:first-child,td:first-child{text-align:left}
svg{display:block;width:100%;height:auto}svg.square{max-width:420px;margin:0 auto}
.grid{stroke:var(--rule)}.axis{stroke:var(--soft)}.ring{fill:none;stroke:var(--rule)}
.tick{fill:var(--soft);font-size:11px}.label{font-size:12px;font-weight:600}text.label:not([fill]){fill:var(--soft)}
.line{fill:none;stroke-width:1.6;stroke-linejoin:round}.faint{fill:none;stroke:var(--accent);opacity:.35}
.dot{fill:var(--accent);opacity:.7}.badge{fill:#fff;font-size:10.5px;font-weight:700}
.level{stroke:var(--alarm);stroke-dasharray:6 4;opacity:.7}.mark{stroke:var(--alarm);stroke-dasharray:3 3}.marktext{fill:var(--alarm);font-size:10px}
";

/// Standard deviations at which the innovation chart has its dashed lines.
const INNOVATION_LEVEL: f64 = 3.0;

/// The whole page.
pub(super) fn page(report: &Report, summary: &Summary) -> String {
    let title = escaped(&report.title);
    let marks = report.chart_marks();
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title>\n<style>{STYLE}</style></head><body><main>\n\
         <h1>{title}</h1><p class=\"sub\">{}</p>\n",
        subtitle(summary)
    );
    if let Some(reason) = &summary.no_fix_reason {
        let _ = writeln!(
            html,
            "<div class=\"card warn\"><h2>No position</h2>{}</div>",
            escaped(reason)
        );
    }
    html += &tiles(summary);
    html += "<div class=\"pair\">\n";
    html += &card("Sky", Some(sky(report)));
    html += &card("Positions, from the first one", ground_plot(&report.track));
    html += "</div>\n";
    html += &card("Position error", position_error(report, &marks));
    html += "<div class=\"pair\">\n";
    let [horizontal, vertical] = &report.stanford;
    html += &card("Horizontal protection", horizontal.svg("horizontal"));
    html += &card("Vertical protection", vertical.svg("vertical"));
    html += "</div>\n";
    html += &card("C/N0", cn0(report, &marks));
    html += &card("Code innovations", innovations(report, &marks));
    html += &card("Shape of the correlation (EWMA)", shapes(report, &marks));
    html += &card("Height above the ellipsoid", height(report, &marks));
    html += &card("Faults", faults(summary));
    if is_of_signals(summary) {
        html += &card("Satellites acquired", Some(satellites(summary)));
    }
    html + "</main></body></html>\n"
}

fn subtitle(summary: &Summary) -> String {
    let time = summary.time.map_or_else(String::new, |time| {
        format!(" · GPS week {}, {:.3} s at the end", time.week, time.tow_s)
    });
    format!("{:.3} s of signal{time}", summary.signal_s)
}

/// Whether signals were received: a position from another receiver's observations acquires none.
fn is_of_signals(summary: &Summary) -> bool {
    !summary.acquired.is_empty() || summary.fixes == 0
}

fn tiles(summary: &Summary) -> String {
    let mut all = Vec::new();
    if is_of_signals(summary) {
        all.push((summary.acquired.len().to_string(), "satellites acquired"));
        let decoded = summary.ephemerides_decoded.len().to_string();
        all.push((decoded, "ephemerides decoded"));
    }
    all.push((summary.fixes.to_string(), "fixes"));
    if let Some(first_s) = summary.first_fix_s {
        all.push((format!("{first_s:.2} s"), "to the first fix"));
    }
    if let Some(p) = &summary.position {
        all.push((format!("{:.6}°", p.lat_deg), "latitude, last"));
        all.push((format!("{:.6}°", p.lon_deg), "longitude, last"));
        all.push((format!("{:.2} m", p.height_m), "height, last"));
    }
    if let Some(v) = &summary.velocity {
        let speed_mps = v.vx_mps.hypot(v.vy_mps).hypot(v.vz_mps);
        all.push((format!("{speed_mps:.2} m/s"), "speed, last"));
    }
    if let Some(error) = &summary.error {
        all.push((
            format!("{:.2} m", error.horizontal_rms_m),
            "horizontal error, rms",
        ));
        all.push((
            format!("{:.2} m", error.vertical_rms_m),
            "vertical error, rms",
        ));
        all.push((
            format!("{:.1} %", 100.0 * error.availability),
            "availability",
        ));
    }
    let tile = |(value, name): &(String, &str)| {
        format!("<div class=\"tile\"><b>{value}</b><span>{name}</span></div>")
    };
    let tiles: String = all.iter().map(tile).collect();
    format!("<div class=\"tiles\">{tiles}</div>\n")
}

fn sky(report: &Report) -> String {
    let tracks: Vec<SkyTrack<'_>> = report
        .satellites
        .iter()
        .enumerate()
        .map(|(i, (satellite, history))| SkyTrack {
            label: satellite.prn.to_string(),
            colour: colour(i),
            path: &history.sky,
        })
        .collect();
    sky_plot(&tracks)
}

fn satellites(summary: &Summary) -> String {
    let mut html = "<table><tr><th></th><th>Doppler (Hz)</th><th>Code phase (chips)</th>\
                    <th>C/N0 (dB-Hz)</th></tr>"
        .to_owned();
    for s in &summary.acquired {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{:.1}</td><td>{:.2}</td><td>{:.1}</td></tr>",
            s.sat, s.doppler_hz, s.code_phase_chips, s.cn0_dbhz
        );
    }
    html + "</table>"
}

fn cn0(report: &Report, marks: &[Mark]) -> Option<String> {
    let chart = Chart {
        unit: "C/N0 (dB-Hz)",
        lines: per_satellite(report, |history| &history.cn0_dbhz),
        marks,
        levels: &[],
        from_zero: false,
    };
    chart.svg()
}

fn innovations(report: &Report, marks: &[Mark]) -> Option<String> {
    let chart = Chart {
        unit: "innovation / sigma",
        lines: per_satellite(report, |history| &history.innovation),
        marks,
        levels: &[-INNOVATION_LEVEL, INNOVATION_LEVEL],
        from_zero: true,
    };
    chart.svg()
}

fn shapes(report: &Report, marks: &[Mark]) -> Option<String> {
    let chart = Chart {
        unit: "mean / limit",
        lines: per_satellite(report, |history| &history.shape),
        marks,
        levels: &[1.0],
        from_zero: true,
    };
    chart.svg()
}

fn position_error(report: &Report, marks: &[Mark]) -> Option<String> {
    let line = |label: &str, colour: &str, series| Line {
        label: label.to_owned(),
        colour: colour.to_owned(),
        series,
    };
    let chart = Chart {
        unit: "error (m)",
        lines: vec![
            line("horizontal", "var(--accent)", &report.horizontal_error_m),
            line("up", "#d08b17", &report.vertical_error_m),
        ],
        marks,
        levels: &[],
        from_zero: true,
    };
    chart.svg()
}

fn height(report: &Report, marks: &[Mark]) -> Option<String> {
    let chart = Chart {
        unit: "height (m)",
        lines: vec![Line {
            label: String::new(),
            colour: "var(--accent)".to_owned(),
            series: &report.height_m,
        }],
        marks,
        levels: &[],
        from_zero: false,
    };
    chart.svg()
}

fn per_satellite<'a>(
    report: &'a Report,
    series: impl Fn(&'a super::SatelliteHistory) -> &'a Series,
) -> Vec<Line<'a>> {
    report
        .satellites
        .iter()
        .enumerate()
        .map(|(i, (satellite, history))| Line {
            label: satellite.to_string(),
            colour: colour(i),
            series: series(history),
        })
        .collect()
}

fn faults(summary: &Summary) -> Option<String> {
    if summary.faults.is_empty() {
        return None;
    }
    let time = |time_s: Option<f64>| time_s.map_or_else(|| "–".to_owned(), |t| format!("{t:.2}"));
    let mut html = "<table><tr><th></th><th>Monitor</th><th>Alarm (s)</th><th>Excluded (s)</th>\
                    <th>Readmitted (s)</th></tr>"
        .to_owned();
    for fault in &summary.faults {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{}</td><td>{:.2}</td><td>{}</td><td>{}</td></tr>",
            fault.sat,
            escaped(&fault.monitor),
            fault.alarm_s,
            time(fault.excluded_s),
            time(fault.readmitted_s)
        );
    }
    Some(html + "</table>")
}

fn card(title: &str, content: Option<String>) -> String {
    content.map_or_else(String::new, |content| {
        format!("<section class=\"card\"><h2>{title}</h2>\n{content}</section>\n")
    })
}

/// Colours as different as possible for neighbours: hues a golden angle apart.
fn colour(index: usize) -> String {
    let hue = (index as f64 * 137.508 + 210.0) % 360.0;
    format!("hsl({hue:.0} 62% 46%)")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
