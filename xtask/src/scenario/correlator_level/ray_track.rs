//! Rays of one transmitter over short stretches of time, as polynomials.
//!
//! What an [`Emitter`] gives at the beginning, middle and end of a stretch of 20 ms is continued by
//! parabolas, used up to 10 ms beyond its ends where rays have no edge. A jerk of 100 m/s^3 bends a
//! ray away from its parabola by at most 0.1 mm.

use anyhow::{Result, ensure};
use gnss_nav::GpsTime;
use gnss_signal::SignalId;

use crate::scenario::antenna::{Emitter, Ray};

/// Length of a stretch, s.
pub(super) const STRETCH_S: f64 = 0.02;
/// Stretches held: more than the two seconds that a channel can go back.
const HELD: usize = 128;

/// Coefficients of 1, x, x^2 in x seconds from the middle of a [`Segment`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Parabola(pub(super) [f64; 3]);

impl Parabola {
    /// Through values at `-half_s`, 0 and `half_s`.
    fn through(values: [f64; 3], half_s: f64) -> Self {
        let [before, middle, after] = values;
        Self([
            middle,
            (after - before) / (2.0 * half_s),
            (after + before - 2.0 * middle) / (2.0 * half_s * half_s),
        ])
    }

    pub(super) fn at(&self, x_s: f64) -> f64 {
        let [a, b, c] = self.0;
        a + x_s * (b + x_s * c)
    }

    pub(super) fn slope(&self, x_s: f64) -> f64 {
        self.0[1] + 2.0 * self.0[2] * x_s
    }
}

/// One ray in a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RayTrack {
    /// Square root of C/N0, Hz^(1/2).
    pub(super) amplitude: Parabola,
    /// Code that arrives, chips since the segment's second.
    pub(super) chips: Parabola,
    /// Carrier phase, cycles.
    pub(super) cycles: Parabola,
}

/// The part of a stretch between two edges.
#[derive(Debug, Clone)]
pub(super) struct Segment {
    end_s: f64,
    pub(super) middle_s: f64,
    /// Whole second of satellite time from which chips count.
    pub(super) second: GpsTime,
    pub(super) rays: Vec<RayTrack>,
    /// Power of all rays together over noise density, Hz.
    pub(super) power_hz: f64,
}

impl Segment {
    /// Sum of the powers of all rays over noise density, Hz.
    pub(super) fn nominal_power_hz(&self) -> f64 {
        self.rays.iter().map(|r| r.amplitude.0[0].powi(2)).sum()
    }

    /// Power of all rays as they add up in the middle (on the triangle of the code).
    fn total_power_hz(&self) -> f64 {
        let mut total = self.nominal_power_hz();
        for (k, a) in self.rays.iter().enumerate() {
            for b in &self.rays[..k] {
                let overlap = (1.0 - (a.chips.0[0] - b.chips.0[0]).abs()).max(0.0);
                let turn = std::f64::consts::TAU * (a.cycles.0[0] - b.cycles.0[0]);
                total += 2.0 * a.amplitude.0[0] * b.amplitude.0[0] * overlap * turn.cos();
            }
        }
        total
    }
}

#[derive(Debug, Clone, Default)]
struct Stretch {
    index: Option<i64>,
    segments: Vec<Segment>,
}

/// One transmitter, with its rays around the present at hand.
pub(super) struct RayTracks {
    pub(super) signal: SignalId,
    emitter: Box<dyn Emitter>,
    stretches: Vec<Stretch>,
    /// Rays at the beginning, middle and end of the segment made last.
    nodes: [Vec<Ray>; 3],
    /// Where that ended; none: at an edge, or nothing was made.
    continues_s: Option<f64>,
}

impl RayTracks {
    pub(super) fn new(emitter: Box<dyn Emitter>) -> Self {
        Self {
            signal: emitter.signal(),
            emitter,
            stretches: vec![Stretch::default(); HELD],
            nodes: Default::default(),
            continues_s: None,
        }
    }

    /// The first edge after `elapsed_s`, s.
    pub(super) fn next_edge_s(&self, elapsed_s: f64) -> f64 {
        let edges = self.emitter.edges_s();
        let next = edges.partition_point(|edge| *edge <= elapsed_s);
        edges.get(next).copied().unwrap_or(f64::INFINITY)
    }

    /// The segment that `elapsed_s` lies in, and the transmitter to ask for its bits.
    pub(super) fn segment(&mut self, elapsed_s: f64) -> Result<(&Segment, &mut dyn Emitter)> {
        let index = (elapsed_s / STRETCH_S).floor() as i64;
        let slot = index.rem_euclid(HELD as i64) as usize;
        if self.stretches[slot].index != Some(index) {
            self.fill(slot, index)?;
        }
        let segments = &self.stretches[slot].segments;
        let within = segments.partition_point(|s| s.end_s <= elapsed_s);
        let segment = &segments[within.min(segments.len() - 1)];
        Ok((segment, self.emitter.as_mut()))
    }

    fn fill(&mut self, slot: usize, index: i64) -> Result<()> {
        let (mut begin_s, end_s) = (index as f64 * STRETCH_S, (index + 1) as f64 * STRETCH_S);
        self.stretches[slot].index = None;
        let mut segments = std::mem::take(&mut self.stretches[slot].segments);
        let mut used = 0;
        while begin_s < end_s {
            let until_s = self.next_edge_s(begin_s).min(end_s);
            if used == segments.len() {
                segments.push(Segment {
                    end_s,
                    middle_s: 0.0,
                    second: GpsTime::new(0, 0.0),
                    rays: Vec::new(),
                    power_hz: 0.0,
                });
            }
            self.fill_segment(&mut segments[used], begin_s, until_s)?;
            used += 1;
            begin_s = until_s;
        }
        segments.truncate(used);
        self.stretches[slot] = Stretch {
            index: Some(index),
            segments,
        };
        Ok(())
    }

    fn fill_segment(&mut self, segment: &mut Segment, begin_s: f64, end_s: f64) -> Result<()> {
        let (middle_s, half_s) = (0.5 * (begin_s + end_s), 0.5 * (end_s - begin_s));
        // A segment begins with what the one before ended with, where there is no edge.
        let known = usize::from(self.continues_s == Some(begin_s));
        self.continues_s = None;
        if known > 0 {
            self.nodes.swap(0, 2);
        }
        let nodes = self.nodes.iter_mut().zip([begin_s, middle_s, end_s]);
        for (node, at_s) in nodes.skip(known) {
            node.clear();
            self.emitter.rays(at_s, middle_s, node)?;
        }
        if self.next_edge_s(begin_s) > end_s {
            self.continues_s = Some(end_s);
        }
        let [before, middle, after] = &self.nodes;
        ensure!(
            before.len() == middle.len() && middle.len() == after.len(),
            "{} has {} rays at {begin_s} s and {} at {end_s} s of one stretch",
            self.signal,
            before.len(),
            after.len()
        );
        segment.end_s = end_s;
        segment.middle_s = middle_s;
        segment.rays.clear();
        segment.power_hz = 0.0;
        let Some(first) = middle.first() else {
            return Ok(());
        };
        let time = first.arrival.code_time;
        segment.second = GpsTime::from_parts(time.week(), time.second().into(), 0.0);
        let code_rate_hz = self.signal.spec().code_rate_hz;
        let rays = before.iter().zip(middle).zip(after);
        segment.rays.extend(rays.map(|((a, b), c)| {
            let through = |value: &dyn Fn(&Ray) -> f64| {
                Parabola::through([value(a), value(b), value(c)], half_s)
            };
            // Whole cycles say nothing, and would cost digits.
            let whole_cycles = b.arrival.carrier_cycles.floor();
            RayTrack {
                amplitude: through(&|ray| ray.amplitude),
                chips: through(&|ray| (ray.arrival.code_time - segment.second) * code_rate_hz),
                cycles: through(&|ray| ray.arrival.carrier_cycles - whole_cycles),
            }
        }));
        segment.power_hz = segment.total_power_hz();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::antenna::Arrival;

    /// A jerk of 100 m/s^3 until 0.053 s, then nothing.
    struct Jerking;

    fn arrival(t: f64) -> Arrival {
        let delay_m = 100.0 / 6.0 * t.powi(3);
        Arrival {
            code_time: GpsTime::new(2350, 5.0) + (t - delay_m / 299_792_458.0),
            carrier_cycles: 1e8 - delay_m / 0.190_3,
        }
    }

    impl Emitter for Jerking {
        fn signal(&self) -> SignalId {
            SignalId::gps_l1_ca(3).unwrap()
        }

        fn edges_s(&self) -> &[f64] {
            &[0.053]
        }

        fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
            if within_s < 0.053 {
                rays.push(Ray {
                    amplitude: 100.0 + 50.0 * elapsed_s,
                    arrival: arrival(elapsed_s),
                });
            }
            Ok(())
        }

        fn bit_sign(&mut self, _: GpsTime, _: usize) -> Result<f32> {
            Ok(1.0)
        }
    }

    #[test]
    fn parabolas_follow_a_jerk_and_end_at_edges() {
        let mut tracks = RayTracks::new(Box::new(Jerking));
        for (asked_s, at_s) in [(0.011, 0.02), (0.035, 0.05), (0.0525, 0.0529)] {
            let (segment, _) = tracks.segment(asked_s).unwrap();
            let [ray] = segment.rays[..] else {
                panic!("{} rays", segment.rays.len())
            };
            let x_s = at_s - segment.middle_s;
            let expected = arrival(at_s);
            let chips = (expected.code_time - GpsTime::new(2350, 5.0)) * 1.023e6;
            // 0.1 mm of range, in chips and cycles, and rounding of cycles near 1e8.
            assert!((ray.chips.at(x_s) - chips).abs() < 3.5e-7);
            let cycles = ray.cycles.at(x_s) - expected.carrier_cycles;
            assert!((cycles - cycles.round()).abs() < 5.5e-4);
            assert!((ray.amplitude.at(x_s) - 100.0 - 50.0 * at_s).abs() < 1e-9);
        }
        assert!(tracks.segment(0.0531).unwrap().0.rays.is_empty());
        assert!(tracks.segment(5.0).unwrap().0.rays.is_empty());
        assert_eq!(tracks.segment(0.01).unwrap().0.rays.len(), 1);
        assert_eq!(tracks.next_edge_s(0.053), f64::INFINITY);
    }
}
