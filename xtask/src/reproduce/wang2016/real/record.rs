//! A quarter of an hour of real pseudoranges of a receiver at rest, as sights: what detectors are
//! judged on. What is known of its noise comes from elsewhere ([`super::noise`]).

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use fault_ml::Sight;
use gnss_nav::geodesy::Geodetic;
use gnss_nav::measurement::{self, Measurement};
use gnss_nav::{EphemerisStore, MeasurementModel, RawMeasurement, SatelliteId, least_squares};
use nalgebra::Vector3;
use receiver::rinex_nav;
use receiver::rinex_obs::{ObservationReader, ObservedEpoch};
use receiver::solve::Weights;

/// Files of the recording below the folder of the data sets.
const OBSERVATIONS: &str = "rinex/01_sept078m_1hz/SEPT078M.21O.gz";
const NAVIGATION: &str = "rinex/01_sept078m_1hz/SEPT078M.21P";

/// Sights of the satellites that are in view throughout, about a position of the receiver's own.
#[derive(Debug, Clone)]
pub struct Record {
    /// Epoch by epoch, a second apart; always the same satellites in the same order.
    pub epochs: Vec<Vec<Sight>>,
}

impl Record {
    /// Reads the recording; `None` where it is absent.
    ///
    /// # Errors
    /// Where it is damaged or cannot be solved.
    pub fn read() -> Result<Option<Self>> {
        let folder = folder();
        let (obs, nav) = (folder.join(OBSERVATIONS), folder.join(NAVIGATION));
        if !(obs.exists() && nav.exists()) {
            return Ok(None);
        }
        Self::from_files(&obs, &nav).map(Some)
    }

    fn from_files(obs: &Path, nav: &Path) -> Result<Self> {
        let Observed { model, formed } = Observed::read(obs, nav)?;
        let first = formed.first().context("no epoch")?;
        let start = least_squares::solve(first, &model, &Vector3::zeros())?;
        let here = start.position_ecef_m;
        let throughout: Vec<SatelliteId> = start
            .satellites
            .iter()
            .map(|s| s.satellite)
            .filter(|id| {
                let is_up = |m: &Measurement| m.satellite == *id && is_above(m, &model, &here);
                formed.iter().all(|epoch| epoch.iter().any(is_up))
            })
            .collect();
        ensure!(throughout.len() > 5, "{} satellites", throughout.len());
        let epochs = formed.iter().map(|epoch| {
            let kept = epoch.iter().filter(|m| throughout.contains(&m.satellite));
            sights(kept, &model, &here)
        });
        Ok(Self {
            epochs: epochs.collect(),
        })
    }

    /// The same with `factor` times the stated deviations.
    #[must_use]
    pub fn told(&self, factor: f64) -> Self {
        let mut told = self.clone();
        for sight in told.epochs.iter_mut().flatten() {
            sight.sigma_m *= factor;
        }
        told
    }

    /// Satellites.
    #[must_use]
    pub fn satellites(&self) -> usize {
        self.epochs.first().map_or(0, Vec::len)
    }
}

/// Folder of the recordings: `GNSS_TEST_DATA`, or `../shared/data` beside the workspace.
pub(super) fn folder() -> PathBuf {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    std::env::var_os("GNSS_TEST_DATA").map_or(beside, PathBuf::from)
}

/// Measurements of a recording as `receiver solve` forms and weighs them.
pub(super) struct Observed {
    pub(super) model: MeasurementModel,
    /// Epoch by epoch.
    pub(super) formed: Vec<Vec<Measurement>>,
}

impl Observed {
    pub(super) fn read(obs: &Path, nav: &Path) -> Result<Self> {
        let nav = rinex_nav::read(nav)?;
        let mut store = EphemerisStore::new();
        for ephemeris in nav.ephemerides {
            store.insert(ephemeris);
        }
        let model = MeasurementModel {
            ionosphere: nav.ionosphere,
            troposphere: true,
            elevation_mask_rad: 10f64.to_radians(),
            errors: Weights::default().errors(),
        };
        let epochs = ObservationReader::open(obs)?;
        let formed = epochs.map(|epoch| Ok(form(&epoch?, &store)));
        Ok(Self {
            model,
            formed: formed.collect::<Result<_>>()?,
        })
    }
}

fn form(epoch: &ObservedEpoch, store: &EphemerisStore) -> Vec<Measurement> {
    let weights = Weights::default();
    let raw: Vec<RawMeasurement> = epoch
        .satellites
        .iter()
        .map(|o| weights.measurement(o, epoch.time, 0.0, &[]))
        .collect();
    measurement::form(epoch.time, &raw, store).measurements
}

pub(super) fn is_above(m: &Measurement, model: &MeasurementModel, here: &Vector3<f64>) -> bool {
    let look = model.predict(&m.state, here, m.receive_time).look;
    look.elevation_rad >= model.elevation_mask_rad
}

/// Sights in east, north, up about `here`; the receiver's clock, the median residual, is taken off as a
/// monitor does.
pub(super) fn sights<'a>(
    measurements: impl Iterator<Item = &'a Measurement>,
    model: &MeasurementModel,
    here: &Vector3<f64>,
) -> Vec<Sight> {
    let enu = Geodetic::from_ecef(here).enu_from_ecef();
    let mut sights: Vec<Sight> = measurements
        .map(|m| {
            let predicted = model.predict(&m.state, here, m.receive_time);
            let towards = enu * predicted.line_of_sight.unit_ecef;
            let variance_m2 = model.variance_m2(
                m.pseudorange_variance_m2,
                m.user_range_accuracy_m,
                &predicted,
            );
            Sight {
                id: u32::from(m.satellite.prn),
                design: [-towards.x, -towards.y, -towards.z, 1.0],
                residual_m: m.pseudorange_m - predicted.pseudorange_m,
                sigma_m: variance_m2.sqrt(),
            }
        })
        .collect();
    take_off_median(&mut sights);
    sights
}

/// Takes off what most satellites have in common.
pub(super) fn take_off_median(sights: &mut [Sight]) {
    let mut sorted: Vec<f64> = sights.iter().map(|s| s.residual_m).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    let Some(upper) = sorted.get(middle).copied() else {
        return;
    };
    let lower = sorted[sorted.len() - 1 - middle];
    for sight in sights {
        sight.residual_m -= 0.5 * (lower + upper);
    }
}
