//! Tests of options, configuration files and sidecars together.

use gnss_signal::sample::SampleFormat;

use super::{Input, Isa, RunOptions};

fn given() -> RunOptions {
    RunOptions {
        input: Some("-".into()),
        format: Some("ri8".to_owned()),
        sample_rate: Some(12e6),
        intermediate_frequency: Some(3e6),
        ..RunOptions::default()
    }
}

fn message(options: RunOptions) -> String {
    options.check().unwrap_err().to_string()
}

#[test]
fn defaults_are_filled_in() {
    let config = given().check().unwrap();
    assert_eq!(config.rate_hz, 10.0);
    assert_eq!(config.prns.len(), 32);
    assert_eq!(config.recording.input, Input::Stdin);
    assert_eq!(config.isa, Isa::Auto);
}

#[test]
fn impossible_values_are_named_with_what_was_expected() {
    type Change = fn(&mut RunOptions);
    let cases: [(Change, &str); 13] = [
        (|o| o.rate = Some(0.0), "--rate is '0': expected above 0"),
        (
            |o| o.duration = Some(0.0),
            "--duration is '0': expected above 0 (s)",
        ),
        (
            |o| o.elevation_mask = Some(91.0),
            "--elevation-mask is '91': expected 0 to 90",
        ),
        (
            |o| o.sample_rate = Some(f64::NAN),
            "--sample-rate is 'NaN': expected 5e5 to 1e9",
        ),
        (
            |o| o.intermediate_frequency = Some(6.1e6),
            "--if is '6100000': expected at most half",
        ),
        (
            |o| o.prn = Some("1,40".to_owned()),
            "--prn is '1,40': expected GPS numbers 1 to 37",
        ),
        (
            |o| o.mode = Some("tensor".to_owned()),
            "--mode is 'tensor': expected one of scalar, vector",
        ),
        (
            |o| o.policy = Some("ignore".to_owned()),
            "--policy is 'ignore': expected one of observe, deweight, exclude",
        ),
        (
            |o| o.time = Some("1672".to_owned()),
            "--time is '1672': expected WEEK:TOW",
        ),
        (
            |o| o.position = Some("1,2,x".to_owned()),
            "--position is '1,2,x': expected LAT,LON,H",
        ),
        (
            |o| o.format = Some("ci4".to_owned()),
            "--format is 'ci4': expected one of ri8",
        ),
        (|o| o.input = None, "--input is missing"),
        (|o| o.truth = Some("t.csv".into()), "--out is missing"),
    ];
    for (change, expected) in cases {
        let mut options = given();
        change(&mut options);
        let found = message(options);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn lists_of_satellites() {
    let mut options = given();
    options.prn = Some("20-22,G07,1".to_owned());
    assert_eq!(options.check().unwrap().prns, [1, 7, 20, 21, 22]);
}

#[test]
fn a_file_is_overlaid_and_its_paths_are_its_own() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("receiver.toml");
    let text = "input = \"a.bin\"\nformat = \"ci8\"\nsample_rate = 4_000_000\nif = -1e3\n\
                rate = 5\nswap_iq = true\nnav = \"a.nav\"\n";
    std::fs::write(&path, text).unwrap();
    let options = RunOptions {
        config: Some(path.clone()),
        rate: Some(2.0),
        ..RunOptions::default()
    };
    let config = options.clone().check().unwrap();
    assert_eq!(
        config.recording.input,
        Input::File(folder.path().join("a.bin"))
    );
    assert_eq!(config.nav, Some(folder.path().join("a.nav")));
    assert_eq!(config.recording.samples.intermediate_frequency_hz, -1e3);
    assert_eq!(config.rate_hz, 2.0);
    assert!(config.recording.samples.swap_iq);

    for (line, expected) in [
        ("rate = 0", ": rate is '0': expected above 0"),
        ("ratte = 1", ": line 2: unknown field `ratte`"),
        ("rate = \"x\"", ": line 2: invalid type"),
        ("rate =", ": line 2: "),
    ] {
        std::fs::write(&path, format!("seed = 1\n{line}\n")).unwrap();
        let found = message(options.clone());
        assert!(found.contains(expected) && !found.contains('\n'), "{found}");
        assert!(found.starts_with(&path.display().to_string()), "{found}");
    }
}

#[test]
fn a_sidecar_describes_the_samples_and_options_overrule_it() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("a.sigmf-data");
    let meta = r#"{"global":{"core:datatype":"ci8","core:sample_rate":2.6e6},
        "captures":[{"core:frequency":1575420000}]}"#;
    std::fs::write(folder.path().join("a.sigmf-meta"), meta).unwrap();
    let options = RunOptions {
        input: Some(recording),
        sample_rate: Some(4e6),
        ..RunOptions::default()
    };
    let samples = options.check().unwrap().recording.samples;
    assert_eq!(samples.format, SampleFormat::Ci8);
    assert_eq!(samples.sample_rate_hz, 4e6);
    assert_eq!(samples.intermediate_frequency_hz, 0.0);
}
