//! What becomes of satellites found faulty where a fix cannot do without them.

use gnss_nav::SatelliteId;
use gnss_nav::filter::Disposition;

use super::NEEDED;

/// Where exclusion would leave fewer satellites than a fix needs, gives each of `told` its disposition of
/// `weighted` instead; returns how many are not left out by that. Only those `above_mask` help a fix, and only to them is
/// it given. All three are in the same order.
///
/// A filter that goes on without measurements drifts until it finds all of them faulty; a wrong one with little
/// weight holds it.
pub(super) fn weight(
    told: &mut [(SatelliteId, Disposition)],
    weighted: &[Disposition],
    above_mask: &[bool],
) -> usize {
    let told = told.iter_mut().zip(weighted).zip(above_mask);
    let mut told: Vec<_> = told
        .filter_map(|(((_, told), weighted), above)| above.then_some((told, *weighted)))
        .collect();
    let excluded = |told: &[(&mut Disposition, Disposition)]| {
        let excluded = told.iter().filter(|(d, _)| **d == Disposition::Exclude);
        excluded.count()
    };
    let before = excluded(&told);
    if before == 0 || told.len() - before >= NEEDED {
        return 0;
    }
    for (told, weighted) in &mut told {
        **told = *weighted;
    }
    before - excluded(&told)
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
    fn a_satellite_below_the_mask_holds_no_fix() {
        let mut all = told(8, 4);
        let mut above_mask = [true; 8];
        above_mask[7] = false;
        assert_eq!(weight(&mut all, &[WEIGHTED; 8], &above_mask), 4);
        assert!(all[..7].iter().all(|(_, d)| *d == WEIGHTED));
        assert_eq!(all[7].1, Disposition::Use);
        // Nor is it missed where three others are left.
        let mut all = told(4, 1);
        assert_eq!(
            weight(&mut all, &[WEIGHTED; 4], &[false, true, true, true]),
            0
        );
        assert_eq!(all, told(4, 1));
    }
}
