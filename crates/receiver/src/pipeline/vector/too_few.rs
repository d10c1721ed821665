//! What becomes of satellites found faulty where a fix cannot do without them.

use gnss_nav::SatelliteId;
use gnss_nav::filter::Disposition;

use super::NEEDED;

/// Where exclusion would leave fewer satellites than a fix needs, gives each of `told` its disposition of
/// `weighted` (in the same order) instead; returns how many are not left out by that.
///
/// A filter that goes on without measurements drifts until it finds all of them faulty; a wrong one with little
/// weight holds it.
pub(super) fn weight(told: &mut [(SatelliteId, Disposition)], weighted: &[Disposition]) -> usize {
    let is_excluded = |disposition: Disposition| disposition == Disposition::Exclude;
    let excluded = told.iter().filter(|(_, d)| is_excluded(*d)).count();
    if excluded == 0 || told.len() - excluded >= NEEDED {
        return 0;
    }
    for ((_, disposition), weighted) in told.iter_mut().zip(weighted) {
        *disposition = *weighted;
    }
    excluded - told.iter().filter(|(_, d)| is_excluded(*d)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WEIGHTED: Disposition = Disposition::Deweight {
        variance_factor: 100.0,
    };

    /// Satellites, the first `faulty` of which are to be left out.
    fn told(satellites: u8, faulty: u8) -> Vec<(SatelliteId, Disposition)> {
        let told = |prn| {
            let is_faulty = prn <= faulty;
            let disposition = if is_faulty {
                Disposition::Exclude
            } else {
                Disposition::Use
            };
            (SatelliteId::gps(prn), disposition)
        };
        (1..=satellites).map(told).collect()
    }

    #[test]
    fn what_a_fix_can_do_without_is_left_out() {
        for (satellites, faulty) in [(8, 4), (4, 0), (3, 0), (0, 0)] {
            let mut all = told(satellites, faulty);
            assert_eq!(weight(&mut all, &vec![WEIGHTED; satellites.into()]), 0);
            assert_eq!(all, told(satellites, faulty));
        }
    }

    #[test]
    fn what_it_cannot_do_without_is_weighted() {
        let mut all = told(8, 5);
        let weighted: Vec<_> = (0..8)
            .map(|k| if k < 5 { WEIGHTED } else { Disposition::Use })
            .collect();
        assert_eq!(weight(&mut all, &weighted), 5);
        assert!(all.iter().map(|(_, d)| *d).eq(weighted));
    }
}
