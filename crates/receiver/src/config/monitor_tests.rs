//! Which monitors run, as options and configuration files say it.

use super::{MonitorChoice, RunOptions};

fn options(text: &str) -> RunOptions {
    toml::from_str(text).unwrap()
}

#[test]
fn a_monitor_or_several_may_be_named() {
    assert_eq!(options("").monitor, Vec::<String>::new());
    assert_eq!(options("monitor = 'svm'").monitor, ["svm"]);
    assert_eq!(
        options("monitor = ['lstm', 'innovation']").monitor,
        ["lstm", "innovation"]
    );
    let given = options("monitor = 'svm'").or(options("monitor = 'lstm'"));
    assert_eq!(given.monitor, ["svm"]);
    let none_given = RunOptions::default().or(options("monitor = 'lstm'"));
    assert_eq!(none_given.monitor, ["lstm"]);
}

#[test]
fn each_runs_once_and_none_stands_alone() {
    let check = |text: &str| {
        let folder = tempfile::tempdir().unwrap();
        let input = folder.path().join("x.bin");
        std::fs::write(&input, [0; 8]).unwrap();
        let options = RunOptions {
            input: Some(input),
            format: Some("ci8".to_owned()),
            sample_rate: Some(2e6),
            ..options(text)
        };
        options.check().map(|config| {
            let idle: Vec<_> = config.idle_monitors().collect();
            (config.monitors, idle)
        })
    };
    use MonitorChoice::{Innovation, Lstm};
    let vector = |text: &str| check(&format!("mode = 'vector'\n{text}")).map(|found| found.0);
    assert_eq!(check("").unwrap(), (vec![], vec![]));
    assert_eq!(vector("").unwrap(), [Innovation]);
    assert_eq!(check("monitor = ['lstm', 'ewma']").unwrap().1, [Lstm]);
    assert_eq!(vector("monitor = 'none'").unwrap(), []);
    assert_eq!(
        vector("monitor = ['lstm', 'innovation', 'lstm']").unwrap(),
        [Innovation, Lstm]
    );
    let error = check("monitor = ['none', 'svm']").unwrap_err().to_string();
    assert!(error.contains("nothing beside it"), "{error}");
    let error = check("monitor = 'shewhart'").unwrap_err().to_string();
    assert!(
        error.contains("one of innovation, svm, lstm, ewma, none"),
        "{error}"
    );
}
