//! What becomes of satellites found faulty where a fix cannot do without them.

use gnss_nav::SatelliteId;
use gnss_nav::filter::Disposition;

use super::NEEDED;

/// Where exclusion would leave fewer satellites than a fix needs, gives each of `told` its disposition of
/// `weighted` (in the same order) instead; returns how many are not left out by that. Only those `above_mask` (again in
/// that order) help a fix.
///
/// A filter that goes on without measurements drifts until it finds all of them faulty; a wrong one with little
/// weight holds it.
pub(super) fn weight(
    told: &mut [(SatelliteId, Disposition)],
    weighted: &[Disposition],
    above_mask: &[bool],
) -> usize {
    let is_excluded = |disposition: Disposition| disposition == Disposition::Exclude;
    let excluded = told.iter().filter(|(_, d)| is_excluded(*d)).count();
    let left = told.iter().zip(above_mask);
    let left = left.filter(|((_, d), above)| **above && !is_excluded(*d));
    if excluded == 0 || left.count() >= NEEDED {
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
            let (weighted, above) = (vec![WEIGHTED; satellites.into()], vec![true; 8]);
            assert_eq!(weight(&mut all, &weighted, &above), 0);
            assert_eq!(all, told(satellites, faulty));
        }
    }

    #[test]
    fn what_it_cannot_do_without_is_weighted() {
        let mut all = told(8, 5);
        let weighted: Vec<_> = (0..8)
            .map(|k| if k < 5 { WEIGHTED } else { Disposition::Use })
            .collect();
        assert_eq!(weight(&mut all, &weighted, &[true; 8]), 5);
        assert!(all.iter().map(|(_, d)| *d).eq(weighted));
    }

    #[test]
    fn a_satellite_below_the_mask_does_not_hold_a_fix() {
        let mut all = told(8, 4);
        let mut above_mask = [true; 8];
        above_mask[7] = false;
        assert_eq!(weight(&mut all, &[WEIGHTED; 8], &above_mask), 4);
        assert!(all.iter().all(|(_, d)| *d == WEIGHTED));
    }
}
