//! Labelled steps as text: one row a step.

use std::io::{BufRead, Write};

use super::dataset::{Dataset, Label, LabelledStep, Sequence};
use super::{ChannelStep, LearnedError, StrengthChange};
use crate::Innovation;

/// Columns.
const HEADER: &str = "scenario,satellite,fault,time_s,code_m,code_sigma_m,rate_mps,rate_sigma_mps,\
given_code_m,given_code_sigma_m,given_rate_mps,given_rate_sigma_mps,cn0_dbhz,cn0_now_hz,\
others_cn0_db,others_now_db,early_ratio,late_ratio,label";
/// Number of them.
const COLUMNS: usize = 19;
/// Steps farther apart than this belong to different sequences, s.
const LONGEST_GAP_S: f64 = 0.15;

/// Writes a header, and a row for each step of `data`. A range rate or ratio of taps that was not measured is
/// left empty.
///
/// # Errors
/// Where `out` cannot be written to.
pub fn write_csv(data: &Dataset, out: &mut impl Write) -> Result<(), LearnedError> {
    writeln!(out, "{HEADER}")?;
    for sequence in &data.sequences {
        for labelled in &sequence.steps {
            let step = &labelled.step;
            write!(
                out,
                "{},{},{},{},",
                sequence.scenario, step.satellite, sequence.fault, labelled.time_s
            )?;
            for innovation in [&step.innovation, &step.given_others] {
                write!(out, "{},{},", innovation.code_m, innovation.code_sigma_m)?;
                if innovation.rate_sigma_mps.is_finite() {
                    write!(
                        out,
                        "{},{},",
                        innovation.rate_mps, innovation.rate_sigma_mps
                    )?;
                } else {
                    write!(out, ",,")?;
                }
            }
            let label = u8::from(labelled.label.is_faulty());
            write!(out, "{},{},", step.cn0_dbhz, step.cn0_now_hz)?;
            let others = &step.others_change;
            write!(out, "{},{},", others.smoothed_db, others.now_db)?;
            match step.tap_ratios {
                Some([early, late]) => write!(out, "{early},{late},")?,
                None => write!(out, ",,")?,
            }
            writeln!(out, "{label}")?;
        }
    }
    Ok(())
}

/// Reads what [`write_csv`] writes. A sequence ends where scenario, satellite or fault change, time goes
/// back, or more than 0.15 s are missing.
///
/// # Errors
/// [`LearnedError::Row`] naming line, column and what was expected.
pub fn read_csv(text: impl BufRead) -> Result<Dataset, LearnedError> {
    let mut lines = text.lines();
    let header = lines.next().transpose()?.unwrap_or_default();
    if header.trim_end() != HEADER {
        return Err(row(1, "header", &header, HEADER));
    }
    let mut data = Dataset::default();
    for (number, line) in (2..).zip(lines) {
        let line = line?;
        if !line.is_empty() {
            append(&mut data, parse(number, &line)?);
        }
    }
    Ok(data)
}

/// A row: scenario, fault and step.
type Row<'a> = (u32, &'a str, LabelledStep);

fn append(data: &mut Dataset, (scenario, fault, step): Row) {
    let goes_on = |sequence: &&mut Sequence| {
        sequence.scenario == scenario
            && sequence.fault == fault
            && sequence.steps.last().is_some_and(|last| {
                let since_s = step.time_s - last.time_s;
                last.step.satellite == step.step.satellite
                    && since_s > 0.0
                    && since_s < LONGEST_GAP_S
            })
    };
    match data.sequences.last_mut().filter(goes_on) {
        Some(sequence) => sequence.steps.push(step),
        None => data.sequences.push(Sequence {
            scenario,
            fault: fault.to_owned(),
            steps: vec![step],
        }),
    }
}

fn parse(number: usize, line: &str) -> Result<Row<'_>, LearnedError> {
    let fields: Vec<&str> = line.trim_end().split(',').collect();
    let &[
        scenario,
        satellite,
        fault,
        time,
        ref innovations @ ..,
        cn0,
        power,
        others,
        others_now,
        early,
        late,
        label,
    ] = fields.as_slice()
    else {
        return Err(miscounted(number, fields.len()));
    };
    let &[c, cs, r, rs, given_c, given_cs, given_r, given_rs] = innovations else {
        return Err(miscounted(number, fields.len()));
    };
    let real = |name, text: &str| -> Result<f64, LearnedError> {
        let value: Option<f64> = text.parse().ok().filter(|v: &f64| v.is_finite());
        value.ok_or_else(|| row(number, name, text, "a finite number"))
    };
    let whole = |name, text: &str| -> Result<u32, LearnedError> {
        text.parse()
            .map_err(|_| row(number, name, text, "a whole number"))
    };
    let innovation = |names: [&'static str; 4], [code, code_sigma, rate, rate_sigma]: [&str; 4]| {
        let measured = !(rate.is_empty() && rate_sigma.is_empty());
        let (rate_mps, rate_sigma_mps) = if measured {
            (real(names[2], rate)?, real(names[3], rate_sigma)?)
        } else {
            (0.0, f64::INFINITY)
        };
        Ok::<_, LearnedError>(Innovation {
            code_m: real(names[0], code)?,
            code_sigma_m: real(names[1], code_sigma)?,
            rate_mps,
            rate_sigma_mps,
        })
    };
    let label = match label {
        "0" => Label::Healthy,
        "1" => Label::Faulty,
        other => return Err(row(number, "label", other, "0 or 1")),
    };
    let step = ChannelStep {
        satellite: whole("satellite", satellite)?,
        innovation: innovation(
            ["code_m", "code_sigma_m", "rate_mps", "rate_sigma_mps"],
            [c, cs, r, rs],
        )?,
        given_others: innovation(
            [
                "given_code_m",
                "given_code_sigma_m",
                "given_rate_mps",
                "given_rate_sigma_mps",
            ],
            [given_c, given_cs, given_r, given_rs],
        )?,
        cn0_dbhz: real("cn0_dbhz", cn0)?,
        cn0_now_hz: real("cn0_now_hz", power)?,
        others_change: StrengthChange {
            smoothed_db: real("others_cn0_db", others)?,
            now_db: real("others_now_db", others_now)?,
        },
        tap_ratios: if early.is_empty() && late.is_empty() {
            None
        } else {
            Some([real("early_ratio", early)?, real("late_ratio", late)?])
        },
    };
    let time_s = real("time_s", time)?;
    let labelled = LabelledStep {
        time_s,
        step,
        label,
    };
    Ok((whole("scenario", scenario)?, fault, labelled))
}

fn miscounted(line: usize, found: usize) -> LearnedError {
    let (found, expected) = (format!("{found} fields"), format!("{COLUMNS} fields"));
    row(line, "row", &found, &expected)
}

fn row(line: usize, name: &str, found: &str, expected: &str) -> LearnedError {
    LearnedError::Row {
        line,
        column: name.to_owned(),
        found: found.chars().take(80).collect(),
        expected: expected.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data() -> Dataset {
        let step = |satellite, time_s, label| {
            let mut step = ChannelStep::normal(satellite, 0.1, -1.0 / 3.0);
            if time_s > 0.03 {
                step.innovation.rate_mps = 0.0;
                step.innovation.rate_sigma_mps = f64::INFINITY;
                step.given_others.code_m = 0.3;
                step.others_change.smoothed_db = -0.1;
                step.others_change.now_db = 2.5;
                step.tap_ratios = None;
            }
            LabelledStep {
                time_s,
                step,
                label,
            }
        };
        let sequence = |scenario, satellite, begin_s: f64| Sequence {
            scenario,
            fault: "ramp".to_owned(),
            steps: vec![
                step(satellite, begin_s, Label::Healthy),
                step(satellite, begin_s + 0.02, Label::Faulty),
            ],
        };
        let sequences = vec![
            sequence(1, 7, 0.01),
            sequence(1, 7, 0.5),
            sequence(2, 7, 0.6),
        ];
        Dataset { sequences }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let mut text = Vec::new();
        write_csv(&data(), &mut text).unwrap();
        // Shortest decimals that give the same bits.
        assert_eq!(read_csv(text.as_slice()).unwrap(), data());
    }

    #[test]
    fn a_bad_row_is_named() {
        let good = "1,7,ramp,0.1,1,8,0.1,0.2,1,8,,,45,600,-1.5,0,0.75,0.74,0";
        let read = |line: &str| read_csv(format!("{HEADER}\n{good}\n{line}\n").as_bytes());
        assert_eq!(read(good).unwrap().steps(), 2);
        for (line, column) in [
            ("1,7,ramp", "row"),
            (
                "x,7,ramp,0.1,1,8,0.1,0.2,1,8,,,45,600,-1.5,0,0.75,0.74,0",
                "scenario",
            ),
            (
                "1,7,ramp,0.1,nan,8,0.1,0.2,1,8,,,45,600,-1.5,0,0.75,0.74,0",
                "code_m",
            ),
            (
                "1,7,ramp,0.1,1,8,,0.2,1,8,,,45,600,-1.5,0,0.75,0.74,0",
                "rate_mps",
            ),
            ("1,7,ramp,0.1,1,8,0.1,0.2,1,8,,,45,600,-1.5,0,,,2", "label"),
            (
                "1,7,ramp,0.1,1,8,0.1,0.2,1,8,,,45,600,-1.5,0,0.75,,0",
                "late_ratio",
            ),
        ] {
            let message = read(line).unwrap_err().to_string();
            assert!(
                message.starts_with(&format!("line 3, {column}: ")),
                "{message}"
            );
        }
        let message = read_csv("a,b\n".as_bytes()).unwrap_err().to_string();
        assert!(
            message.starts_with("line 1, header: found \"a,b\""),
            "{message}"
        );
    }
}
