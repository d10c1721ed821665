//! What the satellites of an epoch make of errors: dilution, and biases that no filter averages.

use nalgebra::{Matrix4, SMatrix, Vector4};

use super::innovation::{Innovations, SatelliteInnovation};
use super::{Covariance, STATES};
use crate::{NavError, SatelliteId};

/// Geometry of the pseudoranges of an epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EpochGeometry {
    /// Satellites it is of.
    pub satellites: usize,
    /// Position dilution of precision.
    pub pdop: f64,
    /// Covariance of position (ECEF) and clock bias by what errs alike epoch after epoch: ephemerides
    /// and modelled delays, m^2.
    ///
    /// A filter that takes each measurement's error for new believes to average them away. Its
    /// estimate settles where weighted least squares would, and keeps this on top of what it reports.
    pub lasting_covariance_m2: Matrix4<f64>,
    /// The same by tracking noise, m^2.
    pub noise_covariance_m2: Matrix4<f64>,
}

impl EpochGeometry {
    /// `covariance` of a filter with the lasting errors added.
    #[must_use]
    pub fn with_lasting(&self, covariance: &Covariance) -> Covariance {
        SMatrix::<f64, STATES, STATES>::from_fn(|row, column| {
            let lasting = if row % 2 == 0 && column % 2 == 0 {
                self.lasting_covariance_m2[(row / 2, column / 2)]
            } else {
                0.0
            };
            covariance[(row, column)] + lasting
        })
    }

    /// `covariance` of a filter that starts from least squares, its position and clock bias known as
    /// well as tracking noise lets them: what lasts it must not average away.
    #[must_use]
    pub fn with_noise_alone(&self, covariance: &Covariance) -> Covariance {
        let mut own = *covariance;
        for row in 0..4 {
            for column in 0..4 {
                own[(2 * row, 2 * column)] = self.noise_covariance_m2[(row, column)];
            }
        }
        own
    }
}

impl Innovations {
    /// Geometry of the pseudoranges of those satellites that `used` names.
    ///
    /// # Errors
    /// [`NavError::Singular`] for fewer than four satellites, or all in a cone.
    pub fn geometry(&self, used: impl Fn(SatelliteId) -> bool) -> Result<EpochGeometry, NavError> {
        let satellites: Vec<&SatelliteInnovation> = self
            .satellites()
            .iter()
            .filter(|s| used(s.satellite))
            .collect();
        let unweighted = inverse(normal(&satellites, |_| 1.0))?;
        let weighted = inverse(normal(&satellites, weight))?;
        let by = |variance: fn(&SatelliteInnovation) -> f64| {
            let weighed = normal(&satellites, |s| weight(s) * weight(s) * variance(s));
            let covariance = weighted * weighed * weighted;
            (covariance + covariance.transpose()) / 2.0
        };
        Ok(EpochGeometry {
            satellites: satellites.len(),
            pdop: unweighted.diagonal().xyz().sum().sqrt(),
            lasting_covariance_m2: by(|s| s.lasting_variance_m2),
            noise_covariance_m2: by(|s| s.code.noise_variance() - s.lasting_variance_m2),
        })
    }

    /// How weighted least squares would move position (ECEF) and clock bias, m, had the pseudoranges
    /// these innovations instead of those of `before`, by another model of the delays.
    ///
    /// # Errors
    /// [`NavError::Singular`] for fewer than four satellites in both, or all in a cone.
    pub fn shift_from(&self, before: &Self) -> Result<Vector4<f64>, NavError> {
        let pairs: Vec<_> = self
            .satellites()
            .iter()
            .filter_map(|now| {
                let mut all = before.satellites().iter();
                let old = all.find(|old| old.satellite == now.satellite)?;
                Some((now, now.code.value() - old.code.value()))
            })
            .collect();
        let satellites: Vec<_> = pairs.iter().map(|(now, _)| *now).collect();
        let right = pairs.iter().fold(Vector4::zeros(), |sum, (now, change)| {
            sum + now.code.row().gradient * (weight(now) * change)
        });
        Ok(inverse(normal(&satellites, weight))? * right)
    }
}

/// Sum of the outer products of the satellites' gradients, weighted.
fn normal(
    satellites: &[&SatelliteInnovation],
    weight: impl Fn(&SatelliteInnovation) -> f64,
) -> Matrix4<f64> {
    satellites.iter().fold(Matrix4::zeros(), |sum, s| {
        let gradient = s.code.row().gradient;
        sum + gradient * gradient.transpose() * weight(s)
    })
}

fn weight(satellite: &SatelliteInnovation) -> f64 {
    1.0 / satellite.code.noise_variance()
}

fn inverse(matrix: Matrix4<f64>) -> Result<Matrix4<f64>, NavError> {
    let cholesky = matrix.cholesky().ok_or(NavError::Singular)?;
    Ok(cholesky.inverse())
}
