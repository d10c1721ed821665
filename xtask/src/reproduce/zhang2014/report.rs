//! The report and the numbers of the summary.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::checks::COEFFICIENTS;
use super::delays::Delay;
use super::false_alarms::{CN0_DBHZ, FalseAlarms};
use super::rays::Detection;
use super::run_lengths::RunLength;
use super::study::Study;
use super::urban::{SCENARIOS, Way};
use crate::order::quantile;
use crate::reproduce::Check;
use crate::reproduce::report::checks_table;

/// Every number of the tables.
#[must_use]
pub fn figures(study: &Study) -> Value {
    let (least, largest) = study.extremes_chips();
    let detected = |seen: &[Detection; 3]| {
        let [paper, frequent, hundred] = seen.each_ref().map(detected);
        json!({ "six_deviations": paper, "frequent_alarms": frequent, "an_alarm_in_a_hundred_hours": hundred })
    };
    let [monitor, narrow, largest_tap] = study.false_alarms.each_ref().map(alarmed);
    json!({
        "error_extremes_chips": [least, largest],
        "coefficients": study.table.iter().map(|row| json!({
            "amplitude": row.amplitude, "noiseless": row.noiseless[0], "noiseless_2_5_mhz": row.noiseless[1],
            "noiseless_1_25_mhz": row.noiseless[2], "fitted": row.fitted, "mean_of_noisy": row.mean_of_noisy,
            "noisy": row.noisy,
        })).collect::<Vec<_>>(),
        "deviations": study.deviations.iter().map(|c| json!({
            "integration_ms": c.integration_ms, "loop_hz": c.loop_hz, "cn0_dbhz": c.cn0_dbhz,
            "bandwidth_mhz": c.bandwidth_mhz.is_finite().then_some(c.bandwidth_mhz), "sigma_chips": c.sigma_chips,
        })).collect::<Vec<_>>(),
        "deviation_by_cn0": study.deviation_by_cn0,
        "two_reflections": { "on_sums": detected(&study.detection), "on_samples": detected(&study.sampled) },
        "run_lengths": study.run_lengths.iter().map(|r| json!({
            "width": r.width, "normal": r.normal, "independent": r.independent, "alarms": r.alarms,
            "closed_loop": r.closed_loop.is_finite().then_some(r.closed_loop),
        })).collect::<Vec<_>>(),
        "delays": study.delays.iter().map(|d| json!({
            "reflection": d.reflection, "error_chips": d.error_chips, "oracle_s": delayed(&d.oracle),
            "six_deviations_s": delayed(&d.paper), "closed_loop_limits_s": delayed(&d.closed_loop),
            "monitor_s": delayed(&d.monitor),
        })).collect::<Vec<_>>(),
        "false_alarms": { "monitor": monitor, "monitor_1_6_mhz": narrow, "largest_tap": largest_tap },
        "urban": study.urban.iter().map(|u| json!({
            "reflected": u.reflected, "flagged": u.flagged, "false_flags": u.false_flags,
            "errors_m": Way::ALL.iter().zip(&u.errors_m).map(|(way, e)| (way.words().0.to_owned(), json!(e)))
                .collect::<serde_json::Map<_, _>>(),
        })).collect::<Vec<_>>(),
    })
}

fn detected(seen: &Detection) -> Value {
    let delay = |part| finite(quantile(seen.delays_s.iter().copied(), part));
    json!({
        "runs": seen.delays_s.len(), "early_alarms": seen.early_alarms,
        "median_delay_s": delay(0.5), "p95_delay_s": delay(0.95),
        "median_correlation": quantile(seen.correlations.iter().copied(), 0.5),
    })
}

fn alarmed(alarms: &FalseAlarms) -> Value {
    let rate = alarms.rate();
    json!({
        "alarms": alarms.alarms, "hours_each": alarms.hours,
        "per_hour": rate.per_hour, "interval_95": [rate.low, rate.high],
    })
}

fn delayed(delay: &Delay) -> [Option<f64>; 2] {
    [finite(delay.median_s), finite(delay.p95_s)]
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// The map of Figures 2 and 3.
#[must_use]
pub fn map_csv(study: &Study) -> String {
    let mut text =
        "delay_chips,phase_deg,tracking_error_chips,observable_T_chips,fitted_T_chips\n".to_owned();
    for p in &study.map {
        let (delay, phase, error) = (p.delay_chips, p.phase_deg, p.error_chips);
        let (observed, fitted) = (p.observed_chips, p.fitted_chips);
        let _ = writeln!(
            text,
            "{delay:.2},{phase:.0},{error:.6},{observed:.1},{fitted:.4}"
        );
    }
    text
}

/// The report.
#[must_use]
pub fn report(study: &Study, checks: &[Check]) -> String {
    INTRODUCTION.to_owned()
        + &table1(study)
        + &deviations(study)
        + &two_reflections(study)
        + &run_lengths(study)
        + &false_alarms(study)
        + &delays(study)
        + &urban(study)
        + NOT_REPRODUCED
        + &checks_table(checks)
}

const INTRODUCTION: &str = "\
# Zhang2014: a control chart on the shape of the correlation

A code loop closed on correlator sums drawn from their distribution: sums of 1 ms, a chip between early and late, no front-end filter, a \
loop of first order and 3 Hz, the carrier tracked; C/N0 43.99 dB-Hz (SNR -23 dB over 5 MHz of complex samples) unless said otherwise. \
T is equation (4), Z its mean (6), limits (9) and (10) with lambda 0.02. The numbers of the paper's tables and figures are lost: beside ours stand those of \
an independent prototype (*oracle*).

Pictures: `figure2.svg` (error of the settled loop), `figure3.svg` (T), `figure4.svg` (a run with two reflections); `map.csv` has all delays and phases.

";

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"))
}

fn table1(study: &Study) -> String {
    let mut text = String::from(
        "## Table 1: correlation of T with the error\n\n\
         Over delays of 0 to 1.5 chip and all phases. *Noisy*: single values of T with the noise of 1 ms; *mean*: averaged over noise at each point. *Fitted*: \
         the peak of a parabola through the taps by least squares, in place of the largest tap.\n\n\
         | amplitude | paper | oracle | noise-free, no filter | 2.5 MHz | 1.25 MHz | fitted | mean of noisy | noisy |\n|---|---|---|---|---|---|---|---|---|\n",
    );
    for (k, row) in study.table.iter().enumerate() {
        let oracle = k.checked_sub(1).and_then(|k| COEFFICIENTS.get(k)).copied();
        let [wide, middle, narrow] = row.noiseless.map(number);
        let _ = writeln!(
            text,
            "| {} | lost | {} | {wide} | {middle} | {narrow} | {} | {} | {} |",
            row.amplitude,
            number(oracle),
            number(row.fitted),
            number(row.mean_of_noisy),
            number(row.noisy),
        );
    }
    text + "\n\"Highly linear, and the more so the stronger the reflection\" holds of T noise-free and in a wide band alone. Behind a filter of 1.25 MHz T does not move at \
            all below an amplitude of 0.4; single noisy values correlate by 0.65 at most, least for the weakest and the strongest reflections. Noise also helps: it \
            dithers T, whose mean then moves between the taps, but the gain is lost again for strong reflections.\n\n"
}

fn deviations(study: &Study) -> String {
    let mut text = String::from(
        "## Which integration gives sigma = 0.0498\n\n\
         Deviation of T (chips) without a fault, by noise bandwidth of the loop; 0 Hz: the replica is held on the signal.\n\n\
         | C/N0 (dB-Hz) | front end, one side (MHz) | integration (ms) | 0 Hz | 2 Hz | 3 Hz | 5 Hz |\n|---|---|---|---|---|---|---|\n",
    );
    for cases in study.deviations.chunks(4) {
        let [first, ..] = cases else { continue };
        let band = if first.bandwidth_mhz.is_finite() {
            first.bandwidth_mhz.to_string()
        } else {
            "no filter".to_owned()
        };
        let sigmas: Vec<_> = cases
            .iter()
            .map(|c| format!("{:.4}", c.sigma_chips))
            .collect();
        let (cn0, ms) = (first.cn0_dbhz, first.integration_ms);
        let _ = writeln!(text, "| {cn0} | {band} | {ms} | {} |", sigmas.join(" | "));
    }
    text += "\n1 ms of complex samples without a filter, in a loop of about 3 Hz: nothing else of this table but 2 ms of real samples comes near. By C/N0, at 1 ms and 3 Hz:\n\n| C/N0 (dB-Hz) |";
    for (cn0, _) in &study.deviation_by_cn0 {
        let _ = write!(text, " {cn0} |");
    }
    text += "\n|---|---|---|---|---|---|---|---|\n| sigma (chips) |";
    for (_, sigma) in &study.deviation_by_cn0 {
        let _ = write!(text, " {sigma:.4} |");
    }
    text + "\n\nA limit of six times 0.0498 fits one C/N0.\n\n"
}

fn two_reflections(study: &Study) -> String {
    let mut text = String::from(
        "## Two reflections (Figure 4)\n\n\
         Amplitude 0.5, delay 0.4 chip, in phase, fading 0.5 Hz, 2 to 4 s; amplitude 0.4, 0.8 chip, in opposition, 0.25 Hz, 5 to 7 s: the paper's are lost.\n\n\
         | limits, signal | runs | alarmed before 2 s | first alarm after the onset, median, p95 (ms) | correlation of Z with the error, median |\n|---|---|---|---|---|\n\
         | oracle, six deviations | 60 | 0 | 116, 147 | 0.921 |\n",
    );
    let [paper, frequent, hundred] = &study.detection;
    let [paper_sampled, frequent_sampled, hundred_sampled] = &study.sampled;
    for (what, seen) in [
        ("six deviations, sums", paper),
        ("of 1.7 alarms an hour, sums", frequent),
        ("of an alarm in a hundred hours, sums", hundred),
        ("six deviations, samples", paper_sampled),
        ("of 1.7 alarms an hour, samples", frequent_sampled),
        ("of an alarm in a hundred hours, samples", hundred_sampled),
    ] {
        let _ = writeln!(
            text,
            "| {what} | {} | {} | {:.0}, {:.0} | {:.3} |",
            seen.delays_s.len(),
            seen.early_alarms,
            1e3 * quantile(seen.delays_s.iter().copied(), 0.5),
            1e3 * quantile(seen.delays_s.iter().copied(), 0.95),
            quantile(seen.correlations.iter().copied(), 0.5),
        );
    }
    text + "\nSix deviations alarm by chance once in some twelve minutes of a closed loop (below): of 60 runs of 2 s before the onset 0.2 are expected to. As many do \
            at their very first values, where (9) and (10) take T for normal and one of 0.3 chip is outside. The other limits come from the tail of simulated closed loops of other seeds, and judge from 0.2 s on, as they were counted.\n\nOn samples (5 MHz, 8 bits, complex, \
            no other satellite) the whole receiver tracks the satellite alone with the paper's settings; the error there is that of such a loop without noise.\n\n"
}

fn run_lengths(study: &Study) -> String {
    let mut text = String::from(
        "## Average run lengths\n\n\
         Steps of 1 ms to a false alarm at 44 dB-Hz, limits as after many steps. *Normal*: independent normal values of the same deviation, by Brook and Evans; \
         *independent*: the same with the nine values that T takes, as often as it takes them. *Closed loop*: simulated.\n\n\
         | L | normal | independent | closed loop (alarms) | oracle: normal, independent, closed loop |\n|---|---|---|---|---|\n",
    );
    let oracle = [
        "2.9e3, 2.1e3, 1.0e3",
        "7.7e4, 2.4e4, 6.7e3",
        "6.0e6, 4.6e5, 6.2e4",
        "1.3e9, 1.3e7, 3.9e5",
    ];
    for (
        RunLength {
            width,
            normal,
            independent,
            closed_loop,
            alarms,
        },
        oracle,
    ) in study.run_lengths.iter().zip(oracle)
    {
        let _ = writeln!(
            text,
            "| {width} | {normal:.2e} | {independent:.2e} | {closed_loop:.2e} ({alarms}) | {oracle} |"
        );
    }
    text + "\nThe jitter of the loop is common to successive T, and T has heavier tails than a normal value: the textbook's run length of six deviations is wrong by \
            more than three orders of magnitude.\n\n"
}

fn false_alarms(study: &Study) -> String {
    let mut text = String::from(
        "## False alarms\n\nOf closed loops without a fault; independent of the runs that limits were chosen by.\n\n| C/N0 (dB-Hz) |",
    );
    for cn0 in CN0_DBHZ {
        let _ = write!(text, " {cn0} |");
    }
    text += " an hour (95 %) |\n|---|---|---|---|---|---|---|---|---|\n";
    let [monitor, narrow, paper] = &study.false_alarms;
    for (what, alarms) in [
        ("monitor of the receiver, no filter", monitor),
        ("monitor of the receiver, 1.6 MHz each side", narrow),
        ("largest tap of 1 ms, limits of closed loops", paper),
    ] {
        let _ = write!(text, "| {what}, {} h each |", alarms.hours);
        alarms
            .alarms
            .iter()
            .for_each(|n| _ = write!(text, " {n} |"));
        let rate = alarms.rate();
        let _ = writeln!(
            text,
            " {:.4} ({:.4} to {:.4}) |",
            rate.per_hour, rate.low, rate.high
        );
    }
    text + "\nThe monitor of the receiver charts how much earlier an inner pair of taps (0.1 chip) finds the signal than an outer one (0.3 chip), on sums of 10 ms in a loop of \
            0.05 Hz, half a chip between early and late; its deviation is that of successive values. It is not quantised, and blind to the jitter of the loop.\n\n"
}

fn delays(study: &Study) -> String {
    let mut text = String::from(
        "## Time to the alarm\n\n\
         44 dB-Hz, 60 runs, onset to alarm, median and 95th percentile (ms). *Monitor*: that of the receiver on sums of 10 ms.\n\n\
         | amplitude, delay (chips), phase (degrees) | error of the loop (chips) | oracle, six deviations | six deviations | limits of closed loops | monitor |\n|---|---|---|---|---|---|\n",
    );
    let words = |d: &Delay| format!("{}, {}", milliseconds(d.median_s), milliseconds(d.p95_s));
    for d in &study.delays {
        let (amplitude, delay, phase) = d.reflection;
        let _ = writeln!(
            text,
            "| {amplitude}, {delay}, {phase} | {:+.3} | {} | {} | {} | {} |",
            d.error_chips,
            words(&d.oracle),
            words(&d.paper),
            words(&d.closed_loop),
            words(&d.monitor),
        );
    }
    text + "\n"
}

fn milliseconds(seconds: f64) -> String {
    if seconds.is_finite() {
        format!("{:.0}", 1e3 * seconds)
    } else {
        "none in 3 s".to_owned()
    }
}

fn urban(study: &Study) -> String {
    let mut text = format!(
        "## Twelve satellites, some reflected\n\n\
         {SCENARIOS} scenarios of each number, 14 epochs a second apart; skies of two nominal constellations above 15 degrees, 44 dB-Hz; amplitude 0.3 to 0.8, \
         delay 0.1 to 1 chip, any phase, fading up to 0.3 Hz; pseudoranges err by the loop and by 1 m. Limits of closed loops; flagged satellites are believed again after 2 s within them, as in the receiver. Weight 1 / (s^2 + (Z / 0.65)^2), residual RAIM with \
         repeated exclusion at 1e-4. 3-D rms and 95th percentile (m), the oracle's rms in brackets.\n\n| reflected |"
    );
    for way in Way::ALL {
        let _ = write!(text, " {} |", way.words().0);
    }
    text += " flagged | false flags |\n|---|---|---|---|---|---|---|---|---|\n";
    for urban in &study.urban {
        let _ = write!(text, "| {} |", urban.reflected);
        for (way, (rms, p95)) in Way::ALL.iter().zip(&urban.errors_m) {
            let oracle = way.words().1[urban.reflected - 1];
            let _ = write!(text, " {rms:.1}, {p95:.1} [{oracle}] |");
        }
        let (false_flags, epochs) = urban.false_flags;
        let _ = writeln!(
            text,
            " {:.0} % | {false_flags} of {epochs} |",
            100.0 * urban.flagged
        );
    }
    text + "\nReflections that are not flagged are those whose error is small at the time. A signal that arrives by reflection alone has an undistorted peak: no chart of shapes sees it.\n\n"
}

const NOT_REPRODUCED: &str = "\
## Not reproduced

- The numbers of Table 1, Table 2 and the figures themselves are lost in the text that was left; only what is said of them can be held against ours.
- The paper gives neither integration time, loop bandwidth nor front end; those above are the ones that give its sigma.

";
