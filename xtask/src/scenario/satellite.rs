//! A satellite as it arrives, with what befalls it.

use std::sync::Arc;

use anyhow::Result;
use gnss_nav::GpsTime;
use gnss_nav::constants::SPEED_OF_LIGHT_MPS;
use gnss_signal::SignalId;

use super::antenna::{Arrival, Emitter, Ray};
use super::broadcast::Broadcast;
use super::fault::{Effect, Influence, RaySpec};
use super::link::{Extra, Link};
use super::power::Power;

/// A satellite of a scenario.
pub struct Satellite {
    signal: SignalId,
    link: Arc<Link>,
    power: Power,
    effects: Vec<Effect>,
    broadcast: Broadcast,
    edges_s: Vec<f64>,
}

impl Satellite {
    /// The satellite of `signal`, received over `link`. Its rays also jump at `edges_s`.
    #[must_use]
    pub fn new(
        signal: SignalId,
        link: Arc<Link>,
        power: Power,
        effects: Vec<Effect>,
        broadcast: Broadcast,
        mut edges_s: Vec<f64>,
    ) -> Self {
        edges_s.extend(effects.iter().flat_map(|effect| effect.span.edges_s()));
        edges_s.sort_by(f64::total_cmp);
        edges_s.dedup();
        Self {
            signal,
            link,
            power,
            effects,
            broadcast,
            edges_s,
        }
    }

    /// C/N0 of its direct signal, dB-Hz; none where nothing arrives.
    #[must_use]
    pub fn cn0_dbhz(&self, elapsed_s: f64) -> Option<f64> {
        let amplitude = self.direct_amplitude(elapsed_s, elapsed_s);
        let present = self.has_direct(elapsed_s) && amplitude > 0.0;
        present.then(|| 20.0 * amplitude.log10())
    }

    /// The way of its signal.
    #[must_use]
    pub fn link(&self) -> &Link {
        &self.link
    }

    /// Its direct signal, whether it arrives or not.
    #[must_use]
    pub fn direct(&self, elapsed_s: f64, within_s: f64) -> Ray {
        let delays = self.effects.iter().map(|e| e.delay_m(elapsed_s, within_s));
        let extra = Extra {
            delay_m: delays.sum(),
            ..Extra::default()
        };
        Ray {
            amplitude: self.direct_amplitude(elapsed_s, within_s),
            arrival: self.link.arrival(elapsed_s, within_s, extra),
        }
    }

    fn active(&self, within_s: f64) -> impl Iterator<Item = &Effect> {
        self.effects
            .iter()
            .filter(move |e| e.span.contains(within_s))
    }

    fn is_blocked(&self, within_s: f64) -> bool {
        self.active(within_s)
            .any(|e| matches!(e.influence, Influence::Blocked))
    }

    fn has_direct(&self, within_s: f64) -> bool {
        !self.active(within_s).any(|e| {
            matches!(
                e.influence,
                Influence::Blocked | Influence::OnlyReflections(_)
            )
        })
    }

    /// Doppler of its direct signal, Hz, by difference over a millisecond.
    #[must_use]
    pub fn doppler_hz(&self, elapsed_s: f64) -> f64 {
        const HALF_S: f64 = 0.5e-3;
        let cycles = |at_s| self.direct(at_s, elapsed_s).arrival.carrier_cycles;
        (cycles(elapsed_s + HALF_S) - cycles(elapsed_s - HALF_S)) / (2.0 * HALF_S)
    }

    /// Amplitude of the direct signal, whether it arrives or not.
    fn direct_amplitude(&self, elapsed_s: f64, within_s: f64) -> f64 {
        let time_s = elapsed_s - self.link.truth().clock.at(elapsed_s, within_s).0;
        let elevation_rad = self.link.elevation_rad(time_s);
        let loss_db: f64 = self
            .active(within_s)
            .map(|effect| match effect.influence {
                Influence::Loss { db } => db * effect.span.share(elapsed_s),
                _ => 0.0,
            })
            .sum();
        let amplitude = self.power.amplitude(elapsed_s, elevation_rad);
        if loss_db == 0.0 {
            return amplitude;
        }
        amplitude * 10f64.powf(-loss_db / 20.0)
    }
}

impl Emitter for Satellite {
    fn signal(&self) -> SignalId {
        self.signal
    }

    fn edges_s(&self) -> &[f64] {
        &self.edges_s
    }

    fn rays(&mut self, elapsed_s: f64, within_s: f64, rays: &mut Vec<Ray>) -> Result<()> {
        if self.is_blocked(within_s) {
            return Ok(());
        }
        let direct = self.direct(elapsed_s, within_s);
        if self.has_direct(within_s) {
            rays.push(direct);
        }
        for effect in self.active(within_s) {
            let (Influence::Reflections(all) | Influence::OnlyReflections(all)) = &effect.influence
            else {
                continue;
            };
            let share = effect.span.share(elapsed_s);
            let since_s = elapsed_s - effect.span.begin_s;
            rays.extend(
                all.iter()
                    .map(|ray| reflected(&direct, ray, since_s, share)),
            );
        }
        Ok(())
    }

    fn bit_sign(&mut self, second: GpsTime, index: usize) -> Result<f32> {
        self.broadcast.sign(second, index)
    }
}

/// The reflection `ray` of `direct`, `since_s` after its onset.
fn reflected(direct: &Ray, ray: &RaySpec, since_s: f64, share: f64) -> Ray {
    Ray {
        amplitude: direct.amplitude * ray.amplitude * share,
        arrival: Arrival {
            code_time: direct.arrival.code_time - ray.delay_m() / SPEED_OF_LIGHT_MPS,
            carrier_cycles: direct.arrival.carrier_cycles + ray.phase_cycles(since_s),
        },
    }
}

#[cfg(test)]
mod tests {
    use crate::scenario::built::Scenario;
    use crate::scenario::spec::ScenarioFile;

    use super::*;

    fn satellite(faults: &str) -> Satellite {
        let text = format!(
            "description = 'x'
start = {{ week = 2350, tow_s = 392400 }}
duration_s = 30
cn0 = {{ fixed_dbhz = 40 }}
trajectory = {{ kind = 'static', at = {{ lat_deg = 47, lon_deg = 8, height_m = 400 }} }}
front_end = {{ format = 'ci8', sample_rate_hz = 4e6 }}
{faults}"
        );
        let file = ScenarioFile::parse("x", "x", std::path::Path::new(""), text).unwrap();
        Scenario::new(&file, None).unwrap().satellites().remove(0)
    }

    fn rays(satellite: &mut Satellite, elapsed_s: f64, within_s: f64) -> Vec<Ray> {
        let mut rays = Vec::new();
        satellite.rays(elapsed_s, within_s, &mut rays).unwrap();
        rays
    }

    #[test]
    fn a_blocked_satellite_is_silent_within_its_edges() {
        let mut satellite =
            satellite("fault = [{ kind = 'blocked', sat = 'all', begin_s = 5, end_s = 6 }]");
        assert_eq!(satellite.edges_s(), [5.0, 6.0]);
        assert_eq!(rays(&mut satellite, 5.0, 4.9).len(), 1);
        assert_eq!(rays(&mut satellite, 5.0, 5.1).len(), 0);
        assert_eq!(satellite.cn0_dbhz(5.5), None);
        assert!((satellite.cn0_dbhz(7.0).unwrap() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn reflections_are_late_by_their_delay_and_turn_by_their_fading() {
        let mut satellite = satellite(
            "[[fault]]
kind = 'multipath'
sat = 'all'
begin_s = 5
ray = [{ amplitude = 0.5, delay_chips = 0.4, phase_deg = 90, fading_hz = 0.25 }]",
        );
        let found = rays(&mut satellite, 7.0, 7.0);
        let (direct, late) = (found[0], found[1]);
        assert!((late.amplitude - 0.5 * direct.amplitude).abs() < 1e-12);
        let chips = (direct.arrival.code_time - late.arrival.code_time) * 1.023e6;
        assert!((chips - 0.4).abs() < 1e-9);
        let cycles = late.arrival.carrier_cycles - direct.arrival.carrier_cycles;
        // Rounding of 1e8 cycles.
        assert!((cycles - 0.75).abs() < 1e-6);
    }

    #[test]
    fn power_fades_and_ranges_ramp() {
        let mut satellite = satellite(
            "[[fault]]
kind = 'attenuated'
sat = 'all'
begin_s = 5
ramp_s = 2
loss_db = 10
[[fault]]
kind = 'ramp'
sat = 'all'
begin_s = 10
end_s = 20
rate_mps = 3",
        );
        assert!((satellite.cn0_dbhz(6.0).unwrap() - 35.0).abs() < 1e-9);
        assert!((satellite.cn0_dbhz(9.0).unwrap() - 30.0).abs() < 1e-9);
        let mut plain = super::tests::satellite("");
        for (time_s, late_m) in [(9.0, 0.0), (12.0, 6.0), (25.0, 30.0)] {
            let (a, b) = (
                rays(&mut plain, time_s, time_s)[0].arrival,
                rays(&mut satellite, time_s, time_s)[0].arrival,
            );
            let found_m = SPEED_OF_LIGHT_MPS * (a.code_time - b.code_time);
            assert!((found_m - late_m).abs() < 1e-6, "{found_m} at {time_s}");
        }
        let doppler_hz = satellite.doppler_hz(15.0) - plain.doppler_hz(15.0);
        // 3 m/s over the wavelength; phases near 1e8 cycles are rounded to 1e-8.
        assert!((doppler_hz + 3.0 / 0.190_293_67).abs() < 1e-3);
    }
}
