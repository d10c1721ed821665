//! Charts of the largest tap, by the tail of simulated closed loops.

use super::chart::ChartSettings;

/// Weight of the newest value.
const LAMBDA: f64 = 0.02;

/// C/N0, dB-Hz, deviation of the largest tap and limit of its mean, chips.
const TABLE: [(f64, f64, f64); 7] = [
    (32.0, 0.238, 0.1460),
    (35.0, 0.202, 0.1240),
    (38.0, 0.152, 0.0965),
    (41.0, 0.0964, 0.0730),
    (44.0, 0.0493, 0.0440),
    (47.0, 0.0200, 0.0211),
    (50.0, 0.00508, 0.0105),
];

/// The chart of [`largest_tap`](super::largest_tap) for a signal of `cn0_dbhz`, lambda 0.02, with no more
/// than 0.01 false alarms an hour.
///
/// For sums of 1 ms, a chip between early and late, a loop of 3 Hz and no front-end filter, 32 to 50 dB-Hz
/// (held constant beyond). The values are quantised and share the jitter of the loop, so that no
/// multiple of their deviation gives a stated rate: limits are the means that 30 h of simulated closed loops
/// exceed, continued by half a decade to a decade of rate (docs/monitors.md). Both are interpolated over C/N0.
#[must_use]
pub fn closed_loop_chart(cn0_dbhz: f64) -> ChartSettings {
    let (sigma, limit) = interpolated(cn0_dbhz);
    let one = ChartSettings {
        sigma,
        lambda: LAMBDA,
        width: 1.0,
        target: 0.0,
    };
    ChartSettings {
        width: limit / one.limit(u32::MAX),
        ..one
    }
}

/// Deviation and limit, chips.
fn interpolated(cn0_dbhz: f64) -> (f64, f64) {
    let [first, .., last] = TABLE;
    let cn0_dbhz = cn0_dbhz.max(first.0).min(last.0);
    let above = TABLE.partition_point(|row| row.0 < cn0_dbhz).max(1);
    let ((from, sigma, limit), (to, sigma_to, limit_to)) = (TABLE[above - 1], TABLE[above]);
    let part = (cn0_dbhz - from) / (to - from);
    (
        sigma + part * (sigma_to - sigma),
        limit + part * (limit_to - limit),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_met_interpolated_and_held_beyond() {
        let limit = |cn0| closed_loop_chart(cn0).limit(u32::MAX);
        for (cn0, sigma, expected) in TABLE {
            assert!((limit(cn0) - expected).abs() < 1e-12, "{cn0}");
            assert!((closed_loop_chart(cn0).sigma - sigma).abs() < 1e-12);
        }
        assert!(limit(44.0) < limit(43.0) && limit(43.0) < limit(41.0));
        assert_eq!((limit(20.0), limit(60.0)), (limit(32.0), limit(50.0)));
        // Six deviations are too few from 44 dB-Hz on.
        assert!(closed_loop_chart(44.0).width > 6.0 && closed_loop_chart(38.0).width < 6.5);
    }
}
