//! What theory says of the runs: noise bandwidths that make receivers comparable, and the velocity error
//! that each part of vector tracking leaves.

use anyhow::{Context, Result};
use gnss_nav::constants::L1_WAVELENGTH_M;
use gnss_nav::dynamics::ClockNoise;
use gnss_nav::prediction::{ReceiverState, predict};
use gnss_nav::{SatelliteId, tracking_noise};
use gnss_signal::tracking::TrackingSettings;
use nalgebra::Vector3;

use super::noise_bandwidth::{
    Impulse, frequency_loop_hz, frequency_loop_response, frequency_loop_setting_hz,
    locked_carrier_response, noise_bandwidth_hz, phase_noise_gain_hz,
};
use super::receivers::{Kind, Vector};
use super::steady_filter::{
    Axes, Model, Rate, SteadyFilter, separate_loops_sigma_mps, single_interval_sigma_mps,
};
use crate::judged::Judged;
use crate::scenario::built::Scenario;

/// Integration of a channel's own loops, s.
pub const INTEGRATION_S: f64 = 0.01;
/// Integrations over which a steered channel in carrier lock takes the mean of its oscillator.
const LOCKED_INTEGRATIONS: usize = 10;
/// The geometry is that of this instant, s, and C/N0 the mean of the seconds about it.
const INSTANT_S: f64 = 15.0;
const ABOUT_S: f64 = 4.0;

/// A satellite in the sky of the scenario.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Which.
    pub satellite: SatelliteId,
    /// Unit vector to it, ECEF.
    pub toward: Vector3<f64>,
    /// C/N0 behind the front end, as measured, dB-Hz.
    pub cn0_dbhz: f64,
}

/// What theory says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Theory {
    /// The sky.
    pub sights: Vec<Sight>,
    /// Noise bandwidth of the product's velocity, x, y and z (ECEF), Hz.
    pub product_hz: Axes,
    /// The same by frequency discriminators alone.
    pub discriminators_hz: Axes,
    /// Setting, Hz, of frequency-locked loops as wide as the product, in the mean of the axes.
    pub loop_setting_hz: f64,
    /// Velocity error by the phase noise of those loops, x, y and z, m/s.
    pub loops_mps: Axes,
    /// Velocity error by the phase noise of the product's locked carriers, x, y and z, m/s.
    pub product_mps: Axes,
    /// Velocity error of discriminators, by what is done with them.
    pub ladder: Ladder,
}

/// Deviation of velocity by the discriminators of 20 ms, x, y and z, m/s, rung by rung.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Ladder {
    /// Least squares of each interval.
    pub single_interval_mps: Axes,
    /// Least squares of loops that share nothing, told of the same dynamics, if it moves so.
    pub separate_loops_mps: Axes,
    /// The same of a clock without white noise of its frequency.
    pub separate_steady_clock_mps: Axes,
    /// The filter of all, if it moves so.
    pub filter_mps: Axes,
    /// The filter of all, noise alone.
    pub filter_noise_mps: Axes,
}

impl Theory {
    /// Of the sky of `scenario`, at the C/N0 that `judged` measured.
    ///
    /// # Errors
    /// Where satellites are missing.
    pub fn new(scenario: &Scenario, judged: &Judged) -> Result<Self> {
        let mut theory = Self {
            sights: sights(scenario, judged)?,
            ..Self::default()
        };
        theory.product_hz = theory.bandwidths_hz(&Vector::PRODUCT)?;
        theory.discriminators_hz = theory.bandwidths_hz(&Vector::DISCRIMINATORS)?;
        let mean_hz = theory.product_hz.iter().sum::<f64>() / 3.0;
        theory.loop_setting_hz = frequency_loop_setting_hz(mean_hz, INTEGRATION_S);
        let frequency =
            frequency_loop_response(theory.loop_setting_hz, INTEGRATION_S, Impulse::PhaseError);
        theory.loops_mps = theory.by_phase_noise_mps(&frequency)?;
        let carrier = locked_response(&Vector::PRODUCT, Impulse::PhaseError);
        theory.product_mps = theory.by_phase_noise_mps(&carrier)?;
        theory.ladder = theory.ladder()?;
        Ok(theory)
    }

    /// Noise bandwidth of the velocity of a receiver that updates every interval, x, y and z, Hz: from true
    /// velocity to its estimate, by what the channels do and what the settled filter does.
    ///
    /// # Errors
    /// Where the satellites do not determine a velocity.
    pub fn bandwidths_hz(&self, of: &Vector) -> Result<Axes> {
        let filter = SteadyFilter::new(&self.rates(of), &model(of)).context(FEW)?;
        let channel = channel_response(of);
        let steps = steps(of);
        let both = |axis: &Vec<f64>| {
            let response = spread(axis, steps, &channel);
            noise_bandwidth_hz(&response, of.integration_s())
        };
        let [x, y, z] = &filter.responses();
        Ok([both(x), both(y), both(z)])
    }

    /// The same of any receiver; `None` of phase-locked loops, whose Doppler is the slope of phases.
    #[must_use]
    pub fn bandwidth_of(&self, kind: &Kind) -> Option<Axes> {
        match kind {
            Kind::PhaseLoops => None,
            Kind::FrequencyLoops { setting_hz } => {
                Some([frequency_loop_hz(*setting_hz, INTEGRATION_S); 3])
            }
            Kind::Vector(of) => self.bandwidths_hz(of).ok(),
        }
    }

    fn rates(&self, of: &Vector) -> Vec<Rate> {
        let variance_m2_s2 = |cn0_dbhz: f64| {
            if of.carrier_phase {
                locked_carrier_variance_m2_s2(cn0_dbhz, of.integration_s())
            } else {
                tracking_noise::half_interval_rate_variance_m2_s2(cn0_dbhz, of.interval_s())
            }
        };
        // An update takes the mean of all intervals since the last.
        let intervals = of.update_s / of.interval_s();
        let rate = |sight: &Sight| Rate {
            toward: sight.toward,
            variance_m2_s2: variance_m2_s2(sight.cn0_dbhz) / intervals,
        };
        self.sights.iter().map(rate).collect()
    }

    /// Velocity error, m/s, of least squares of rates that answer to a wrong phase by `response`.
    fn by_phase_noise_mps(&self, response: &[f64]) -> Result<Axes> {
        let gain_mps = L1_WAVELENGTH_M * phase_noise_gain_hz(response);
        let rate = |sight: &Sight| Rate {
            toward: sight.toward,
            variance_m2_s2: gain_mps.powi(2)
                * phase_variance_cycles2(sight.cn0_dbhz, INTEGRATION_S),
        };
        let rates: Vec<Rate> = self.sights.iter().map(rate).collect();
        single_interval_sigma_mps(&rates).context(FEW)
    }

    fn ladder(&self) -> Result<Ladder> {
        let of = Vector::DISCRIMINATORS;
        let (rates, model) = (self.rates(&of), model(&of));
        let filter = SteadyFilter::new(&rates, &model).context(FEW)?;
        let steady = Model {
            clock: ClockNoise {
                white_m2_per_s: 0.0,
                ..model.clock
            },
            ..model
        };
        Ok(Ladder {
            separate_steady_clock_mps: separate_loops_sigma_mps(&rates, &steady).context(FEW)?,
            single_interval_mps: single_interval_sigma_mps(&rates).context(FEW)?,
            separate_loops_mps: separate_loops_sigma_mps(&rates, &model).context(FEW)?,
            filter_mps: filter.modelled_sigma_mps(),
            filter_noise_mps: filter.noise_sigma_mps(),
        })
    }
}

const FEW: &str = "the satellites of the scenario do not determine a velocity";

/// What the product's filter is told.
fn model(of: &Vector) -> Model {
    Model {
        interval_s: of.update_s,
        q_a_m2_per_s3: of.q_a_m2_per_s3,
        clock: ClockNoise::tcxo(),
    }
}

/// Integrations between two updates.
fn steps(of: &Vector) -> usize {
    (of.update_s / of.integration_s()).round().max(1.0) as usize
}

/// What a channel makes of an impulse of its range rate in one integration.
fn channel_response(of: &Vector) -> Vec<f64> {
    if of.carrier_phase {
        locked_response(of, Impulse::Frequency)
    } else {
        let steps = steps(of);
        vec![1.0 / steps as f64; steps]
    }
}

fn locked_response(of: &Vector, impulse: Impulse) -> Vec<f64> {
    let phase_hz = TrackingSettings::default().locked_bandwidth.phase_hz;
    locked_carrier_response(phase_hz, of.integration_s(), LOCKED_INTEGRATIONS, impulse)
}

/// The response of the filter, which updates every `steps` integrations, to that of a channel.
fn spread(filter: &[f64], steps: usize, channel: &[f64]) -> Vec<f64> {
    let mut both = vec![0.0; filter.len() * steps + channel.len()];
    // What is left after that is below rounding.
    let lasting = filter.iter().rposition(|h| h.abs() > 1e-12);
    for (update, h) in filter.iter().enumerate().take(lasting.map_or(0, |k| k + 1)) {
        for (sum, c) in both.iter_mut().skip(update * steps).zip(channel) {
            *sum += h * c;
        }
    }
    both
}

/// Variance that a steered channel states of the range rate of a locked carrier, (m/s)^2: the jitter of
/// the oscillator's phase (2 B T of the Costas loop's) at both ends of the mean, and as much again.
fn locked_carrier_variance_m2_s2(cn0_dbhz: f64, integration_s: f64) -> f64 {
    let phase_hz = TrackingSettings::default().locked_bandwidth.phase_hz;
    let jitter = 2.0 * phase_hz * integration_s * phase_variance_cycles2(cn0_dbhz, integration_s);
    let span_s = LOCKED_INTEGRATIONS as f64 * integration_s;
    4.0 * jitter * (L1_WAVELENGTH_M / span_s).powi(2)
}

/// Variance of the phase of one integration (Kaplan2017, 8.80), cycles^2.
fn phase_variance_cycles2(cn0_dbhz: f64, integration_s: f64) -> f64 {
    let snr = 10f64.powf(cn0_dbhz / 10.0) * integration_s;
    (1.0 + 0.5 / snr) / (2.0 * snr) / std::f64::consts::TAU.powi(2)
}

fn sights(scenario: &Scenario, judged: &Judged) -> Result<Vec<Sight>> {
    let at = scenario.truth.trajectory.at(INSTANT_S);
    let receiver = ReceiverState {
        time: scenario.truth.start + INSTANT_S,
        position_ecef_m: at.position_ecef_m,
        velocity_ecef_mps: at.velocity_ecef_mps,
        clock_drift_mps: 0.0,
    };
    let mut sights = Vec::new();
    for heard in &scenario.heard {
        let expected = predict(&heard.broadcast, &receiver)?;
        let path = expected.state.position_ecef_m - at.position_ecef_m;
        let satellite = heard.satellite;
        sights.push(Sight {
            satellite,
            toward: path.normalize(),
            cn0_dbhz: mean_cn0_dbhz(judged, satellite)
                .with_context(|| format!("{satellite} was not tracked"))?,
        });
    }
    Ok(sights)
}

fn mean_cn0_dbhz(judged: &Judged, satellite: SatelliteId) -> Option<f64> {
    let about = judged
        .channels
        .iter()
        .filter(|c| c.satellite == satellite && (c.time_s - INSTANT_S).abs() < ABOUT_S);
    let levels = about.filter_map(|channel| channel.cn0_dbhz);
    let (sum, count) = levels.fold((0.0, 0.0), |(sum, n), level| (sum + level, n + 1.0));
    (count > 0.0).then_some(sum / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four satellites round about and one overhead, at 45 dB-Hz.
    fn theory() -> Theory {
        let low = |azimuth_rad: f64| Vector3::new(azimuth_rad.sin(), azimuth_rad.cos(), 0.4);
        let all = [low(0.1), low(1.6), low(3.3), low(4.8), Vector3::z()];
        let sights = all.into_iter().enumerate().map(|(k, toward)| Sight {
            satellite: SatelliteId::gps(k as u8 + 1),
            toward: toward.normalize(),
            cn0_dbhz: 45.0,
        });
        Theory {
            sights: sights.collect(),
            ..Theory::default()
        }
    }

    #[test]
    fn without_memory_the_bandwidth_is_that_of_an_interval() {
        let of = Vector {
            q_a_m2_per_s3: 1e6,
            ..Vector::DISCRIMINATORS
        };
        for hz in theory().bandwidths_hz(&of).unwrap() {
            // A mean over 20 ms has 25 Hz; the previous velocity keeps a part of 1e-5.
            assert!((hz - 25.0).abs() < 0.01, "{hz}");
        }
    }

    #[test]
    fn a_filter_that_trusts_locked_carriers_leaves_their_bandwidth() {
        let carrier = locked_response(&Vector::PRODUCT, Impulse::Frequency);
        let carrier_hz = noise_bandwidth_hz(&carrier, INTEGRATION_S);
        for hz in theory().bandwidths_hz(&Vector::PRODUCT).unwrap() {
            // The filter's own bandwidth is above 20 Hz; gains near one leave a part of 1e-3.
            assert!(
                hz <= carrier_hz && hz > 0.9 * carrier_hz,
                "{hz} of {carrier_hz}"
            );
        }
    }

    #[test]
    fn each_rung_leaves_less_than_the_one_before() {
        let ladder = theory().ladder().unwrap();
        for axis in 0..3 {
            assert!(ladder.single_interval_mps[axis] > ladder.filter_mps[axis]);
            assert!(ladder.separate_loops_mps[axis] > ladder.filter_mps[axis]);
            assert!(ladder.filter_mps[axis] > ladder.filter_noise_mps[axis]);
        }
    }
}
