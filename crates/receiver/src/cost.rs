//! What a run cost: `cost.json`.

use std::time::Instant;

use serde::Serialize;

use crate::sink::rounded;

/// `cost.json`; what the system does not tell is absent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cost {
    /// Signal received, s.
    pub signal_s: f64,
    /// Time on the wall clock, s.
    pub wall_s: f64,
    /// Processor time of all threads, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu_s: Option<f64>,
    /// Signal received over time on the wall clock.
    pub real_time_factor: f64,
    /// Most memory held at any time, bytes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub peak_rss_bytes: Option<u64>,
    /// Channels tracked, mean over the navigation epochs.
    pub channels_mean: f64,
}

/// Measures a run from its creation on.
#[derive(Debug, Clone, Copy)]
pub struct Meter {
    start: Instant,
}

impl Meter {
    /// Starts the clock.
    #[must_use]
    pub fn start() -> Self {
        Self {
            start: Instant::now(),
        }
    }

    /// The cost so far. Processor time and memory are those of the whole process.
    #[must_use]
    pub fn cost(&self, signal_s: f64, channels_mean: f64) -> Cost {
        let wall_s = self.start.elapsed().as_secs_f64();
        Cost {
            signal_s,
            wall_s: rounded(wall_s, 6),
            cpu_s: std::fs::read_to_string("/proc/self/stat")
                .ok()
                .and_then(|stat| cpu_seconds(&stat)),
            real_time_factor: rounded(signal_s / wall_s.max(1e-9), 3),
            peak_rss_bytes: std::fs::read_to_string("/proc/self/status")
                .ok()
                .and_then(|status| peak_bytes(&status)),
            channels_mean: rounded(channels_mean, 3),
        }
    }
}

/// User and system time from `/proc/self/stat` (proc(5), fields 14 and 15).
fn cpu_seconds(stat: &str) -> Option<f64> {
    /// Clock ticks in a second, as Linux shows them to every program (USER_HZ).
    const TICKS_PER_S: f64 = 100.0;
    // The second field, a name in parentheses, may hold anything; fields are counted after it.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace().skip(11);
    let user: u64 = fields.next()?.parse().ok()?;
    let system: u64 = fields.next()?.parse().ok()?;
    Some((user + system) as f64 / TICKS_PER_S)
}

/// Peak resident memory from `/proc/self/status`, given there in KiB.
fn peak_bytes(status: &str) -> Option<u64> {
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linux_accounting_is_read() {
        let stat = "42 (a ) b) S 1 2 3 4 5 6 7 8 9 10 150 50 0 0 20 0";
        assert_eq!(cpu_seconds(stat), Some(2.0));
        assert_eq!(peak_bytes("VmPeak: 9 kB\nVmHWM:\t 12 kB\n"), Some(12_288));
        assert_eq!(cpu_seconds("nonsense"), None);
    }
}
