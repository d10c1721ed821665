//! Which whole milliseconds belong to the code phases.

use nalgebra::Vector3;

use super::fit::{Fit, Ranged, UNKNOWNS, fit};
use super::screen::Screen;
use super::{Anchor, Channel};
use crate::chi_square::chi_square_threshold;
use crate::constants::{CA_PERIOD_M, SPEED_OF_LIGHT_MPS};
use crate::geodesy::Geodetic;
use crate::measurement::MeasurementModel;
use crate::prediction::received_state;
use crate::{GpsTime, NavError};

/// Grid over the prior: no point of it is more than 71 km and 10 s from a node, which spreads
/// the pseudoranges by less than 300 km, so that the milliseconds are right at the best node.
const GRID_M: f64 = 100e3;
const GRID_S: f64 = 20.0;

/// Nodes to either side at most, so that an absurd prior cannot take forever.
const GRID_REACH: i32 = 8;

/// Wrong satellites at most.
const EXCLUSIONS: usize = 2;

/// Redundant satellites left after an exclusion: with one, chance alone finds a fit too often.
const REDUNDANT_AFTER_EXCLUSION: usize = 2;

/// With so many redundant satellites wrong milliseconds do not pass by chance: each of them would
/// have to agree to tens of metres in hundreds of kilometres. The first fit that passes is taken.
const UNMISTAKABLE: usize = 3;

/// A fit this many uncertainties from the prior is not believed.
const BELIEVED: f64 = 2.0;

/// Millisecond ambiguities up to a common number, and a start near which they hold.
struct Hypothesis {
    milliseconds: Vec<i64>,
    start: (Vector3<f64>, GpsTime),
}

/// The best fit that passes the residual test, with the fewest exclusions.
pub(super) fn search<'a>(
    channels: &[Channel<'a>],
    anchor: &Anchor,
    model: &MeasurementModel,
    false_alarm_probability: f64,
) -> Result<Fit<'a>, NavError> {
    let hypotheses = hypotheses(channels, anchor)?;
    for exclusions in 0..=EXCLUSIONS {
        let redundant = channels.len().saturating_sub(UNKNOWNS + exclusions);
        if exclusions > 0 && redundant < REDUNDANT_AFTER_EXCLUSION {
            break;
        }
        // Without redundancy every hypothesis fits: only the one nearest the prior is tried.
        let tried = if redundant == 0 { 1 } else { hypotheses.len() };
        let threshold = chi_square_threshold(redundant.max(1), false_alarm_probability)?;
        let mut passed = hypotheses[..tried].iter().filter_map(|h| {
            best_without(channels, h, exclusions, anchor, model)
                .filter(|fit| fit.chi_square <= threshold)
        });
        let best = if redundant >= UNMISTAKABLE {
            passed.next()
        } else {
            passed.min_by(|a, b| score(a, anchor).total_cmp(&score(b, anchor)))
        };
        if let Some(best) = best {
            return Ok(best);
        }
    }
    Err(NavError::NoFit {
        satellites: channels.len(),
    })
}

/// The best fit near the prior of one hypothesis, over all ways to leave out `exclusions`.
fn best_without<'a>(
    channels: &[Channel<'a>],
    hypothesis: &Hypothesis,
    exclusions: usize,
    anchor: &Anchor,
    model: &MeasurementModel,
) -> Option<Fit<'a>> {
    let all = ranged(channels, hypothesis, &[]);
    let screen = Screen::new(&all, anchor, model, hypothesis.start, BELIEVED);
    combinations(channels.len(), exclusions)
        .iter()
        .filter(|out| screen.lets_pass(out))
        .filter_map(|out| {
            let ranged = ranged(channels, hypothesis, out);
            fit(&ranged, anchor, model, hypothesis.start).ok()
        })
        .filter(|fit| is_near(fit, anchor))
        .min_by(|a, b| score(a, anchor).total_cmp(&score(b, anchor)))
}

fn score(fit: &Fit, anchor: &Anchor) -> f64 {
    fit.chi_square + fit.strangeness(anchor)
}

fn is_near(fit: &Fit, anchor: &Anchor) -> bool {
    (fit.position_ecef_m - anchor.position_ecef_m).norm() <= BELIEVED * anchor.position_sigma_m
        && (fit.time - anchor.time).abs() <= BELIEVED * anchor.time_sigma_s
}

fn ranged<'a>(channels: &[Channel<'a>], h: &Hypothesis, out: &[usize]) -> Vec<Ranged<'a>> {
    channels
        .iter()
        .zip(&h.milliseconds)
        .enumerate()
        .filter(|(index, _)| !out.contains(index))
        .map(|(_, (&channel, &milliseconds))| Ranged {
            channel,
            milliseconds,
        })
        .collect()
}

/// Sets of `size` (at most two) indices below `count`.
fn combinations(count: usize, size: usize) -> Vec<Vec<usize>> {
    match size {
        0 => vec![Vec::new()],
        1 => (0..count).map(|a| vec![a]).collect(),
        _ => (0..count)
            .flat_map(|a| (a + 1..count).map(move |b| vec![a, b]))
            .collect(),
    }
}

/// Distinct hypotheses over the grid, from the prior outwards.
fn hypotheses(channels: &[Channel], anchor: &Anchor) -> Result<Vec<Hypothesis>, NavError> {
    let mut found: Vec<Hypothesis> = Vec::new();
    for start in nodes(anchor) {
        let phases = phases(channels, start)?;
        for milliseconds in cuts(&phases) {
            if !found.iter().any(|h| h.milliseconds == milliseconds) {
                found.push(Hypothesis {
                    milliseconds,
                    start,
                });
            }
        }
    }
    Ok(found)
}

/// Predicted pseudorange plus measured fraction, in milliseconds: whole, but for the common bias
/// and the error of the position and time assumed.
fn phases(channels: &[Channel], start: (Vector3<f64>, GpsTime)) -> Result<Vec<f64>, NavError> {
    channels
        .iter()
        .map(|channel| {
            let (state, path) = received_state(channel.ephemeris, &start.0, start.1)?;
            let pseudorange_m = path.range_m - SPEED_OF_LIGHT_MPS * state.clock_bias_s;
            Ok((pseudorange_m + channel.fraction_m) / CA_PERIOD_M)
        })
        .collect()
}

/// Whole parts of `phases` relative to the first, for the three likeliest values of the bias.
///
/// The fractions lie on a circle and bunch around the bias; which whole numbers they get depends
/// only on where the circle is cut, and that must be in a gap between bunches. Wrong satellites
/// split gaps: two of them leave the right one among the largest three.
fn cuts(phases: &[f64]) -> Vec<Vec<i64>> {
    let mut fractions: Vec<f64> = phases.iter().map(|p| p - p.floor()).collect();
    fractions.sort_by(f64::total_cmp);
    let mut gaps: Vec<(f64, f64)> = (0..fractions.len())
        .map(|i| {
            let next = fractions.get(i + 1).copied();
            let next = next.unwrap_or_else(|| fractions[0] + 1.0);
            (next - fractions[i], f64::midpoint(next, fractions[i]))
        })
        .collect();
    gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
    gaps.iter()
        .take(1 + EXCLUSIONS)
        .map(|(_, cut)| {
            let first = (phases[0] - cut).floor();
            phases
                .iter()
                .map(|p| ((p - cut).floor() - first) as i64)
                .collect()
        })
        .collect()
}

/// Nodes of the grid, nearest to the anchor first.
fn nodes(anchor: &Anchor) -> Vec<(Vector3<f64>, GpsTime)> {
    let reach = |uncertainty: f64, spacing: f64| {
        ((uncertainty / spacing).ceil() as i32).clamp(0, GRID_REACH)
    };
    let across = reach(anchor.position_sigma_m - GRID_M / 2.0, GRID_M);
    let along = reach(anchor.time_sigma_s - GRID_S / 2.0, GRID_S);
    let ecef_from_enu = Geodetic::from_ecef(&anchor.position_ecef_m)
        .enu_from_ecef()
        .transpose();
    let mut nodes = Vec::new();
    for east in -across..=across {
        for north in -across..=across {
            for late in -along..=along {
                nodes.push((east, north, late));
            }
        }
    }
    nodes.sort_by_key(|(east, north, late)| east * east + north * north + late * late);
    nodes
        .iter()
        .map(|&(east, north, late)| {
            let enu = Vector3::new(f64::from(east), f64::from(north), 0.0) * GRID_M;
            (
                anchor.position_ecef_m + ecef_from_enu * enu,
                anchor.time + f64::from(late) * GRID_S,
            )
        })
        .collect()
}
