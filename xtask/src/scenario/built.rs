//! A scenario made ready: geometry, signals, faults and truth, from its file.

use std::sync::Arc;

use anyhow::{Context, Result, ensure};
use gnss_nav::atmosphere::Klobuchar;
use gnss_nav::lnav::{IonosphereUtc, LnavEncoder, UtcParameters};
use gnss_nav::{Ephemeris, Geodetic, SatelliteId};
use gnss_signal::SignalId;
use nalgebra::Vector3;

use super::antenna::{Emitter, Gap, Interference, Reception, Scene};
use super::broadcast::{self, BitErrors, Broadcast};
use super::clock::ReceiverClock;
use super::constellation::{Choice, Constellation, ConstellationSpec};
use super::counterfeit::{Counterfeit, LiftOff};
use super::fault::{Account, Effect, FaultSpec};
use super::link::{Atmosphere, Link, Truth};
use super::message::Message;
use super::power::{Power, PowerSpec};
use super::satellite::Satellite;
use super::spec::{IonosphereSpec, PropagationSpec, ReceiverSpec, ScenarioFile, TroposphereSpec};

/// Longest scenario, s: its orbits must be those of one ephemeris.
const LONGEST_S: f64 = 7200.0;
/// Leap seconds that the message tells (since 2017).
pub(super) const LEAP_SECONDS: i8 = 18;
/// Ionosphere where neither the file nor the constellation gives one.
const DEFAULT_IONOSPHERE: Klobuchar = Klobuchar {
    alpha: [1.2e-8, 7.5e-9, -6.0e-8, -6.0e-8],
    beta: [98_304.0, 32_768.0, -196_608.0, -65_536.0],
};

/// A scenario ready to be received.
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// What it is, in a line.
    pub description: String,
    /// The receiver as it truly is.
    pub truth: Arc<Truth>,
    /// Rows of truth.csv a second.
    pub truth_rate_hz: f64,
    /// The front end.
    pub reception: Reception,
    /// Samples made, s.
    pub duration_s: f64,
    /// Seed of everything random.
    pub seed: u64,
    /// Which delays the signals have.
    pub propagation: PropagationSpec,
    /// The ionosphere that is broadcast.
    pub ionosphere: Klobuchar,
    /// The satellites that are heard, by PRN.
    pub heard: Vec<Heard>,
    /// What the receiver is told.
    pub receiver: ReceiverSpec,
    /// Faults, in the order of the file.
    pub accounts: Vec<Account>,
    /// Samples that are lost.
    pub gaps: Vec<Gap>,
    counterfeits: Vec<(usize, LiftOff)>,
    interference: Vec<Interference>,
    jump_edges_s: Vec<f64>,
}

/// A satellite that is heard.
#[derive(Clone)]
pub struct Heard {
    /// Which.
    pub satellite: SatelliteId,
    /// What it broadcasts at the start.
    pub broadcast: Ephemeris,
    signal: SignalId,
    link: Arc<Link>,
    power: Power,
    effects: Vec<Effect>,
    message: Message,
    later: Option<(f64, Message)>,
    bit_errors: Vec<BitErrors>,
}

impl Scenario {
    /// Makes the scenario of `file` ready, with `seed` in place of its own where given.
    ///
    /// # Errors
    /// Names file, line and what is impossible.
    pub fn new(file: &ScenarioFile, seed: Option<u64>) -> Result<Self> {
        let spec = &file.spec;
        let duration_s = file.locate(&spec.duration_s, |s| within(*s, 1e-3, LONGEST_S))?;
        let truth_rate_hz = file.locate(&spec.truth_rate_hz, |hz| within(*hz, 1.0, 1e4))?;
        let start = file.locate(&spec.start, |start| {
            within(start.tow_s, 0.0, 604_799.999_999)?;
            within(f64::from(start.week), 0.0, 1e4)?;
            Ok(start.time())
        })?;
        for fault in &spec.fault {
            file.locate(fault, FaultSpec::check)?;
        }
        let seed = seed.unwrap_or(spec.seed);
        let faults = || spec.fault.iter().map(|fault| fault.get_ref());
        let gaps = sorted(faults().filter_map(FaultSpec::gap).collect());
        // The receiver's clock runs on where samples are lost.
        let covered_s = duration_s + gaps.iter().map(|gap| gap.duration_s).sum::<f64>();
        let trajectory = file.locate(&spec.trajectory, |trajectory| {
            trajectory.trajectory(covered_s, &file.folder)
        })?;
        let jumps_s: Vec<_> = faults().filter_map(FaultSpec::clock_jump_s).collect();
        let jump_edges_s = jumps_s.iter().map(|(at_s, _)| *at_s).collect();
        let clock = match &spec.clock {
            None => ReceiverClock::new(&Default::default(), covered_s, seed, jumps_s),
            Some(section) => file.locate(section, |clock| {
                ReceiverClock::new(clock, covered_s, seed, jumps_s)
            }),
        }?;
        let truth = Arc::new(Truth {
            start,
            trajectory,
            clock,
            duration_s: covered_s,
        });
        let constellation = match &spec.constellation {
            None => ConstellationSpec::default().constellation(start, &file.folder),
            Some(section) => file.locate(section, |c| c.constellation(start, &file.folder)),
        }?;
        let mut scenario = Self {
            name: file.name.clone(),
            description: spec.description.clone(),
            truth_rate_hz,
            reception: file.locate(&spec.front_end, |f| f.reception())?,
            duration_s,
            seed,
            ionosphere: as_broadcast(
                spec.propagation
                    .klobuchar
                    .map(Klobuchar::from)
                    .or(constellation.ionosphere)
                    .unwrap_or(DEFAULT_IONOSPHERE),
            ),
            propagation: spec.propagation,
            heard: Vec::new(),
            receiver: spec
                .receiver
                .as_ref()
                .map_or_else(ReceiverSpec::default, |r| r.get_ref().clone()),
            accounts: Vec::new(),
            gaps,
            counterfeits: Vec::new(),
            interference: Vec::new(),
            jump_edges_s,
            truth,
        };
        scenario.hear(file, &constellation)?;
        for fault in &spec.fault {
            file.locate(fault, |f| scenario.befall(f))?;
        }
        Ok(scenario)
    }

    /// Finds the satellites that are heard.
    fn hear(&mut self, file: &ScenarioFile, constellation: &Constellation) -> Result<()> {
        let spec = &file.spec;
        let atmosphere = Atmosphere {
            ionosphere: (spec.propagation.ionosphere == IonosphereSpec::Klobuchar)
                .then_some(self.ionosphere),
            troposphere: spec.propagation.troposphere == TroposphereSpec::Saastamoinen,
        };
        let power = |satellite| match &spec.cn0 {
            None => PowerSpec::default().power(satellite),
            Some(section) => file.locate(section, |cn0| cn0.power(satellite)),
        };
        let place = Geodetic::from_ecef(&self.truth.trajectory.at(0.0).position_ecef_m);
        let horizon_rad = -place.horizon_dip_rad();
        let named = match &constellation.choice {
            Choice::Named(named) => Some(named),
            Choice::Above(_) => None,
        };
        for ephemeris in &constellation.ephemerides {
            let satellite = ephemeris.satellite;
            if named.is_some_and(|named| !named.contains(&satellite)) {
                continue;
            }
            let link = Link::new(&self.truth, ephemeris, atmosphere)?;
            let elevation_rad = link
                .elevation_rad(0.0)
                .max(link.elevation_rad(self.duration_s));
            match &constellation.choice {
                Choice::Above(_) if ephemeris.health != 0 => continue,
                Choice::Above(mask_rad) if elevation_rad < *mask_rad => continue,
                Choice::Named(_) if elevation_rad < horizon_rad => {
                    let what = format!(
                        "satellites: {satellite} stands at {:.1} degrees: expected one above the \
                         horizon at {:.1}",
                        elevation_rad.to_degrees(),
                        horizon_rad.to_degrees()
                    );
                    return Err(match &spec.constellation {
                        Some(section) => file.error(section, what),
                        None => anyhow::anyhow!(what),
                    });
                }
                _ => {}
            }
            let message = lnav(ephemeris, &self.ionosphere, self.truth.start.week())?;
            self.heard.push(Heard {
                satellite,
                broadcast: *ephemeris,
                signal: SignalId::gps_l1_ca(satellite.prn)?,
                link: Arc::new(link),
                power: power(satellite)?,
                effects: Vec::new(),
                message,
                later: None,
                bit_errors: Vec::new(),
            });
        }
        ensure!(!self.heard.is_empty(), "no satellite stands above the mask");
        if let Some(section) = &spec.cn0 {
            file.locate(section, |cn0| cn0.check(&self.names()))?;
        }
        Ok(())
    }

    /// The satellites that are heard, by PRN.
    #[must_use]
    pub fn names(&self) -> Vec<SatelliteId> {
        self.heard.iter().map(|heard| heard.satellite).collect()
    }

    /// Lets a fault befall what it names.
    fn befall(&mut self, fault: &FaultSpec) -> Result<()> {
        let account = fault.account(&self.names())?;
        self.interference
            .extend(fault.interference(self.truth.duration_s)?);
        for index in 0..self.heard.len() {
            if account.satellites.contains(&self.heard[index].satellite) {
                self.befall_one(index, fault)?;
            }
        }
        self.accounts.push(account);
        Ok(())
    }

    fn befall_one(&mut self, index: usize, fault: &FaultSpec) -> Result<()> {
        let (ionosphere, week) = (self.ionosphere, self.truth.start.week());
        let Some(heard) = self.heard.get_mut(index) else {
            return Ok(());
        };
        heard.effects.extend(fault.effect());
        match *fault {
            FaultSpec::BitErrors { probability, .. } => heard.bit_errors.push(BitErrors {
                span: fault.span(),
                probability,
            }),
            FaultSpec::WrongEphemeris {
                begin_s,
                along_m,
                radial_m,
                clock_m,
                ..
            } => {
                let wrong = broadcast::wrong(&heard.broadcast, along_m, radial_m, clock_m)?;
                let message = lnav(&wrong, &ionosphere, week)?;
                if begin_s > 0.0 {
                    heard.later = Some((begin_s, message));
                } else {
                    (heard.broadcast, heard.message) = (wrong, message);
                }
            }
            FaultSpec::Counterfeit {
                power_db,
                hold_s,
                lift_mps,
                drag_enu_mps,
                ..
            } => self.counterfeits.push((
                index,
                LiftOff {
                    span: fault.span(),
                    power_db,
                    hold_s,
                    lift_mps,
                    drag_enu_mps: Vector3::from(drag_enu_mps),
                },
            )),
            _ => {}
        }
        Ok(())
    }

    /// The satellites as they arrive.
    #[must_use]
    pub fn satellites(&self) -> Vec<Satellite> {
        let satellite = |heard: &Heard| {
            Satellite::new(
                heard.signal,
                Arc::clone(&heard.link),
                heard.power.clone(),
                heard.effects.clone(),
                self.broadcast(heard),
                self.jump_edges_s.clone(),
            )
        };
        self.heard.iter().map(satellite).collect()
    }

    fn broadcast(&self, heard: &Heard) -> Broadcast {
        Broadcast::new(
            self.truth.start,
            heard.message.clone(),
            heard.later.clone(),
            heard.bit_errors.clone(),
            self.seed
                .wrapping_mul(64)
                .wrapping_add(heard.satellite.prn.into()),
        )
    }

    /// Everything that arrives at the antenna, and the front end.
    #[must_use]
    pub fn scene(&self) -> Scene {
        let mut emitters: Vec<Box<dyn Emitter>> = Vec::new();
        for satellite in self.satellites() {
            emitters.push(Box::new(satellite));
        }
        for (index, lift_off) in &self.counterfeits {
            let Some(heard) = self.heard.get(*index) else {
                continue;
            };
            emitters.push(Box::new(Counterfeit::new(
                heard.signal,
                Arc::clone(&heard.link),
                heard.power.clone(),
                lift_off.clone(),
                self.broadcast(heard),
                self.jump_edges_s.clone(),
            )));
        }
        Scene {
            reception: self.reception,
            duration_s: self.duration_s,
            emitters,
            interference: self.interference.clone(),
            gaps: self.gaps.clone(),
            seed: self.seed,
        }
    }

    /// Elapsed time by the receiver's clock when it has taken `sampled_s` of samples.
    #[must_use]
    pub fn elapsed_s(&self, sampled_s: f64) -> f64 {
        self.gaps.iter().fold(sampled_s, |elapsed_s, gap| {
            if elapsed_s >= gap.begin_s {
                elapsed_s + gap.duration_s
            } else {
                elapsed_s
            }
        })
    }
}

fn within(value: f64, low: f64, high: f64) -> Result<f64> {
    ensure!(
        (low..=high).contains(&value),
        "{value}: expected {low} to {high}"
    );
    Ok(value)
}

fn sorted(mut gaps: Vec<Gap>) -> Vec<Gap> {
    gaps.sort_by(|a, b| a.begin_s.total_cmp(&b.begin_s));
    gaps
}

/// The model with the steps of its broadcast parameters (IS-GPS-200, table 20-X), so that the
/// signal is delayed by what the receiver is told.
fn as_broadcast(model: Klobuchar) -> Klobuchar {
    let round = |values: [f64; 4], exponents: [i32; 4]| {
        std::array::from_fn(|k| {
            let step = f64::from(exponents[k]).exp2();
            (values[k] / step).round() * step
        })
    };
    Klobuchar {
        alpha: round(model.alpha, [-30, -27, -24, -24]),
        beta: round(model.beta, [11, 14, 16, 16]),
    }
}

/// The message of a satellite: its ephemeris, the ionosphere and leap seconds.
fn lnav(ephemeris: &Ephemeris, ionosphere: &Klobuchar, week: i32) -> Result<Message> {
    let parameters = IonosphereUtc {
        klobuchar: *ionosphere,
        utc: UtcParameters {
            a0_s: 0.0,
            a1: 0.0,
            tot_s: 0,
            wnt: week.rem_euclid(256) as u8,
            delta_tls_s: LEAP_SECONDS,
            wn_lsf: week.rem_euclid(256) as u8,
            dn: 1,
            delta_tlsf_s: LEAP_SECONDS,
        },
    };
    let encoder = LnavEncoder::new(ephemeris)
        .and_then(|encoder| encoder.with_ionosphere_utc(&parameters))
        .with_context(|| format!("message of {}", ephemeris.satellite))?;
    Ok(Message::Lnav(Box::new(encoder)))
}
