//! What the satellites of an epoch make of errors: dilution, and biases that no filter averages.

use nalgebra::{Matrix4, SMatrix};

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
        let sum = |weight: &dyn Fn(&SatelliteInnovation) -> f64| {
            satellites.iter().fold(Matrix4::zeros(), |sum, s| {
                let gradient = s.code.row().gradient;
                sum + gradient * gradient.transpose() * weight(s)
            })
        };
        let inverse = |matrix: Matrix4<f64>| matrix.cholesky().map(|c| c.inverse());
        let unweighted = inverse(sum(&|_| 1.0)).ok_or(NavError::Singular)?;
        let weight = |s: &SatelliteInnovation| 1.0 / s.code.noise_variance();
        let weighted = inverse(sum(&weight)).ok_or(NavError::Singular)?;
        let lasting = sum(&|s| weight(s) * weight(s) * s.lasting_variance_m2);
        Ok(EpochGeometry {
            satellites: satellites.len(),
            pdop: unweighted.diagonal().xyz().sum().sqrt(),
            lasting_covariance_m2: weighted * lasting * weighted,
        })
    }
}
