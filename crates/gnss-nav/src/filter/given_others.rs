//! What is left of an innovation once the other satellites of the epoch have been heard.
//!
//! Most of an innovation is common to all: the clock's drift and the receiver's acceleration since the last
//! epoch, of which a filter assumes far more than there mostly is. A fault of one channel is not.

use nalgebra::{Matrix4, Vector4};

use super::covariance::{Blocks, Covariance};
use super::innovation::{Innovation, Innovations};
use crate::{NavError, SatelliteId};

/// An innovation and its variance, given those of the other satellites; m and m^2, or m/s and (m/s)^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Measured minus what prediction and the other satellites let expect.
    pub value: f64,
    /// Its variance by the filter's covariance and the noise of all.
    pub variance: f64,
}

impl Deviation {
    /// Square of the value over its variance.
    #[must_use]
    pub const fn normalised_squared(&self) -> f64 {
        self.value * self.value / self.variance
    }
}

/// Both measurements of a satellite, given those of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenOthers {
    /// Which.
    pub satellite: SatelliteId,
    /// Of its pseudorange, m.
    pub code: Deviation,
    /// Of its range rate, m/s; `None` where none was measured.
    pub rate: Option<Deviation>,
}

impl Innovations {
    /// Every satellite's innovations given those of the others that `believed` names, by the `covariance` that
    /// the filter predicted: pseudoranges given pseudoranges, range rates given range rates.
    ///
    /// With m and C mean and covariance of the error state after all of an epoch, h the row and r the noise of
    /// one measurement and l = h C h' / r: (nu - h m) / (1 - l) of variance r / (1 - l), the deleted residual
    /// (Cook1982); nu - h m of variance r + h C h' where it was not one of them.
    ///
    /// # Errors
    /// [`NavError::Singular`] for a covariance that is not positive definite.
    pub fn given_others(
        &self,
        covariance: &Covariance,
        believed: impl Fn(SatelliteId) -> bool,
    ) -> Result<Vec<GivenOthers>, NavError> {
        let predicted = Blocks::from_interleaved(covariance);
        let heard = self.satellites().iter().filter(|s| believed(s.satellite));
        let code = Heard::new(&predicted.offset, heard.clone().map(|s| s.code))?;
        let rate = Heard::new(&predicted.rate, heard.filter_map(|s| s.rate))?;
        let given = self.satellites().iter().map(|s| {
            let own = believed(s.satellite);
            GivenOthers {
                satellite: s.satellite,
                code: code.given_others(&s.code, own),
                rate: s.rate.map(|innovation| rate.given_others(&innovation, own)),
            }
        });
        Ok(given.collect())
    }
}

/// An error state after all believed measurements of a kind.
struct Heard {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl Heard {
    fn new(
        predicted: &Matrix4<f64>,
        innovations: impl Iterator<Item = Innovation>,
    ) -> Result<Self, NavError> {
        let inverse = |matrix: Matrix4<f64>| {
            let cholesky = matrix.cholesky().ok_or(NavError::Singular)?;
            Ok::<_, NavError>(cholesky.inverse())
        };
        let mut information = inverse(*predicted)?;
        let mut weighted = Vector4::zeros();
        for innovation in innovations {
            let gradient = innovation.row().gradient;
            let weight = 1.0 / innovation.noise_variance();
            information += gradient * gradient.transpose() * weight;
            weighted += gradient * (weight * innovation.value());
        }
        let covariance = inverse(information)?;
        Ok(Self {
            mean: covariance * weighted,
            covariance,
        })
    }

    fn given_others(&self, innovation: &Innovation, own: bool) -> Deviation {
        let gradient = innovation.row().gradient;
        let noise = innovation.noise_variance();
        let left = innovation.value() - gradient.dot(&self.mean);
        let state = gradient.dot(&(self.covariance * gradient));
        if own {
            let share = 1.0 - state / noise;
            Deviation {
                value: left / share,
                variance: noise / share,
            }
        } else {
            Deviation {
                value: left,
                variance: noise + state,
            }
        }
    }
}
