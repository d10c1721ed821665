//! SigMF sidecars: how a recording is written, from the metadata beside it.
//!
//! Read are `global.core:datatype`, `global.core:sample_rate` and `captures[0].core:frequency`
//! (the radio frequency at which the recording has its zero; the intermediate frequency is
//! 1575.42 MHz minus it). `SigMF` has no name for packed formats and none for the intermediate
//! frequency of real recordings, so `global` may also hold `gnss:format` (a name of
//! [`SampleFormat`], used in place of `core:datatype`), `gnss:if_hz` (used in place of
//! `core:frequency`) and `gnss:swap_iq`.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use gnss_signal::Signal;
use gnss_signal::sample::SampleFormat;
use serde::Deserialize;

use crate::ReceiverError;

/// What a sidecar says; what it does not say is absent.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sidecar {
    /// Encoding of the samples.
    pub format: Option<SampleFormat>,
    /// Samples per second.
    pub sample_rate_hz: Option<f64>,
    /// Frequency at which a signal without Doppler appears, Hz.
    pub intermediate_frequency_hz: Option<f64>,
    /// Whether I and Q are exchanged.
    pub swap_iq: Option<bool>,
}

#[derive(Deserialize)]
struct Metadata {
    #[serde(default)]
    global: Global,
    #[serde(default)]
    captures: Vec<Capture>,
}

#[derive(Deserialize, Default)]
struct Global {
    #[serde(rename = "core:datatype")]
    datatype: Option<String>,
    #[serde(rename = "core:sample_rate")]
    sample_rate_hz: Option<f64>,
    #[serde(rename = "gnss:format")]
    format: Option<String>,
    #[serde(rename = "gnss:if_hz")]
    intermediate_frequency_hz: Option<f64>,
    #[serde(rename = "gnss:swap_iq")]
    swap_iq: Option<bool>,
}

#[derive(Deserialize)]
struct Capture {
    #[serde(rename = "core:frequency")]
    frequency_hz: Option<f64>,
}

/// Where the sidecar of `recording` is, if it has one: `FILE.sigmf-meta`, or FILE with its
/// extension replaced.
#[must_use]
pub fn sidecar_of(recording: &Path) -> Option<PathBuf> {
    let mut appended = recording.as_os_str().to_owned();
    appended.push(".sigmf-meta");
    [
        PathBuf::from(appended),
        recording.with_extension("sigmf-meta"),
    ]
    .into_iter()
    .find(|path| path.is_file())
}

/// Reads the sidecar of `recording`; nothing where there is none.
///
/// # Errors
/// [`ReceiverError::File`] or [`ReceiverError::Content`], naming the sidecar.
pub fn read(recording: &Path) -> Result<Sidecar, ReceiverError> {
    let Some(path) = sidecar_of(recording) else {
        return Ok(Sidecar::default());
    };
    let text = match std::fs::read(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Sidecar::default()),
        Err(source) => return Err(ReceiverError::File { path, source }),
        Ok(text) => text,
    };
    parse(&text).map_err(|what| ReceiverError::Content { path, what })
}

/// Reads the text of a sidecar.
///
/// # Errors
/// What was found and what was expected.
pub fn parse(text: &[u8]) -> Result<Sidecar, String> {
    // An object first: a structure would be read from a list of its fields as well.
    let metadata: Metadata = serde_json::from_slice(text)
        .map(serde_json::Value::Object)
        .and_then(serde_json::from_value)
        .map_err(|error| format!("no SigMF metadata: {error}"))?;
    let global = metadata.global;
    let carrier_hz = metadata.captures.first().and_then(|c| c.frequency_hz);
    let from_carrier = carrier_hz.map(|hz| Signal::GpsL1Ca.spec().carrier_hz - hz);
    Ok(Sidecar {
        format: match (&global.format, &global.datatype) {
            (Some(name), _) => Some(known("gnss:format", name)?),
            (None, Some(name)) => Some(known("core:datatype", name)?),
            (None, None) => None,
        },
        sample_rate_hz: global.sample_rate_hz,
        intermediate_frequency_hz: global.intermediate_frequency_hz.or(from_carrier),
        swap_iq: global.swap_iq,
    })
}

fn known(key: &str, name: &str) -> Result<SampleFormat, String> {
    name.parse().map_err(|error| format!("{key}: {error}"))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_complex_recording_off_the_carrier() {
        let text = br#"{"global":{"core:datatype":"ci8","core:sample_rate":4000000.0,
            "core:version":"1.0.0"},"captures":[{"core:sample_start":0,"core:frequency":1575000000}],
            "annotations":[]}"#;
        let sidecar = parse(text).unwrap();
        assert_eq!(sidecar.format, Some(SampleFormat::Ci8));
        assert_eq!(sidecar.sample_rate_hz, Some(4e6));
        assert_eq!(sidecar.intermediate_frequency_hz, Some(420e3));
    }

    #[test]
    fn extension_keys_come_first() {
        let text = br#"{"global":{"core:datatype":"ru8","gnss:format":"r2_lsb",
            "gnss:if_hz":5499998.474,"core:sample_rate":20480000},
            "captures":[{"core:frequency":1575420000}]}"#;
        let sidecar = parse(text).unwrap();
        assert_eq!(sidecar.format, Some(SampleFormat::R2Lsb));
        assert_eq!(sidecar.intermediate_frequency_hz, Some(5_499_998.474));
    }

    #[test]
    fn broken_metadata_is_one_line() {
        for text in [
            &b"{\"global\":"[..],
            b"",
            b"[]",
            b"[1]",
            b"{\"global\":{\"core:sample_rate\":\"x\"}}",
        ] {
            let what = parse(text).unwrap_err();
            assert!(
                what.starts_with("no SigMF metadata") && !what.contains('\n'),
                "{what}"
            );
        }
        let what = parse(br#"{"global":{"core:datatype":"cf64_le"}}"#).unwrap_err();
        assert!(
            what.contains("core:datatype") && what.contains("cf32_le"),
            "{what}"
        );
    }

    #[test]
    fn both_places_are_looked_at() {
        let folder = tempfile::tempdir().unwrap();
        let recording = folder.path().join("a.sigmf-data");
        assert_eq!(read(&recording).unwrap(), Sidecar::default());
        std::fs::write(
            folder.path().join("a.sigmf-meta"),
            r#"{"global":{"core:sample_rate":1}}"#,
        )
        .unwrap();
        assert_eq!(read(&recording).unwrap().sample_rate_hz, Some(1.0));
        std::fs::write(folder.path().join("a.sigmf-data.sigmf-meta"), "{").unwrap();
        let error = read(&recording).unwrap_err().to_string();
        assert!(
            error.contains("a.sigmf-data.sigmf-meta: no SigMF metadata"),
            "{error}"
        );
    }

    proptest! {
        #[test]
        fn arbitrary_bytes_are_one_line_of_error(
            bytes in proptest::collection::vec(any::<u8>(), 0..200),
        ) {
            // Bytes that are metadata by chance say nothing of the recording.
            match parse(&bytes) {
                Ok(sidecar) => prop_assert_eq!(sidecar, Sidecar::default()),
                Err(what) => prop_assert!(!what.contains('\n'), "{}", what),
            }
        }

        #[test]
        fn damaged_metadata_is_read_as_it_stands_or_refused(
            at in 0_usize..80,
            byte in any::<u8>(),
            length in 0_usize..90,
        ) {
            let mut text = br#"{"global":{"core:datatype":"ci8","core:sample_rate":4000000}}"#.to_vec();
            if let Some(place) = text.get_mut(at) {
                *place = byte;
            }
            text.truncate(length);
            match parse(&text) {
                Ok(sidecar) => prop_assert!(sidecar.sample_rate_hz.is_none_or(f64::is_finite)),
                Err(what) => prop_assert!(!what.contains('\n'), "{}", what),
            }
        }

        #[test]
        fn arbitrary_values_are_taken_over_or_refused(rate in any::<f64>(), name in ".{0,12}") {
            let text = serde_json::json!({
                "global": {"core:sample_rate": rate, "core:datatype": name},
            });
            match parse(text.to_string().as_bytes()) {
                Ok(sidecar) => {
                    prop_assert_eq!(sidecar.format, name.parse().ok());
                    // JSON has no infinity: such a rate is written as absent.
                    prop_assert_eq!(sidecar.sample_rate_hz, rate.is_finite().then_some(rate));
                }
                Err(what) => {
                    prop_assert!(name.parse::<SampleFormat>().is_err() && !what.contains('\n'));
                }
            }
        }
    }
}
