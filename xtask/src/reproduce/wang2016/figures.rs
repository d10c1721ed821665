//! Figures 2 to 4: cumulative ratios of every satellite, and the decision of both filters.

use anyhow::{Context, Result, anyhow};
use fault_ml::particle::{ParticleParameters, ParticleRaim, RatioForm};
use plotters::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::super::chart::{Area, Drawing, Drawn, legend};
use super::setting::{
    EPOCHS, Geometry, ONSET, SATELLITES, STEPPED, STEPS_M, Truth, residuals, sights,
};

/// First epoch shown, s.
const FIRST_SHOWN: usize = 450;
/// Width and height of a picture, px.
const SIZE: (u32, u32) = (900, 760);
/// The alarm threshold tau.
const THRESHOLD: f64 = 20.0;
/// Seed of the run that is drawn.
const SEED: u64 = 0;

const FAULTY: RGBColor = RGBColor(200, 30, 30);
const SOUND: RGBColor = RGBColor(150, 150, 150);
const BOOTSTRAP: RGBColor = RGBColor(30, 90, 180);

/// Cumulative ratios of one run, by epoch and satellite, in the paper's form.
type Trace = Vec<[f64; SATELLITES]>;

/// What the pictures show of one truth.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// Geometry of the run.
    pub geometry: &'a Geometry,
    /// Noise of the run.
    pub truth: Truth,
    /// Assumed standard deviation, m.
    pub sigma_m: f64,
    /// The bootstrap filter.
    pub bootstrap: ParticleParameters,
    /// The filter with a swarm.
    pub swarm: ParticleParameters,
}

impl Shown<'_> {
    /// File name and SVG of Figures 2 to 4, one for every step.
    ///
    /// # Errors
    /// Where a run cannot be made or drawn.
    pub fn pictures(&self) -> Result<Vec<(String, String)>> {
        let figure = |(number, step_m): (usize, f64)| {
            let swarm = self.trace(self.swarm, step_m)?;
            let bootstrap = self.trace(self.bootstrap, step_m)?;
            let svg = draw(number, step_m, &swarm, &bootstrap);
            Ok((
                format!("figure{number}.svg"),
                svg.map_err(|e| anyhow!("figure {number}: {e}"))?,
            ))
        };
        (2..).zip(STEPS_M).map(figure).collect()
    }

    fn trace(&self, parameters: ParticleParameters, step_m: f64) -> Result<Trace> {
        let residuals = residuals(&self.truth, SEED);
        let random = ChaCha8Rng::seed_from_u64(SEED);
        let mut raim = ParticleRaim::new(parameters.check()?, random);
        let mut trace = Trace::new();
        for k in 0..EPOCHS {
            raim.epoch(
                k as f64,
                &sights(k, self.geometry, &residuals, self.sigma_m, step_m),
            )?;
            let mut ratios = [0.0; SATELLITES];
            for (id, ratio) in raim.ratios(RatioForm::Paper) {
                let slot = ratios.get_mut(id as usize).context("unknown satellite")?;
                // Before the first judged epoch there is no sum.
                *slot = if ratio.is_finite() { ratio } else { 0.0 };
            }
            trace.push(ratios);
        }
        Ok(trace)
    }
}

fn draw(number: usize, step_m: f64, swarm: &Trace, bootstrap: &Trace) -> Drawn<String> {
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let title =
            format!("Figure {number}: step of {step_m} m at {ONSET} s (simulated, seed {SEED})");
        let root = root.titled(&title, ("sans-serif", 20))?;
        let (upper, lower) = root.split_vertically(SIZE.1 / 2 - 15);
        draw_ratios(&upper, swarm)?;
        draw_decisions(&lower, swarm, bootstrap)?;
        root.present()?;
    }
    Ok(svg)
}

fn shown(trace: &Trace, value: impl Fn(&[f64; SATELLITES]) -> f64) -> Vec<(f64, f64)> {
    let epochs = trace.iter().enumerate().skip(FIRST_SHOWN);
    epochs
        .map(|(k, ratios)| (k as f64, value(ratios)))
        .collect()
}

fn decision(ratios: &[f64; SATELLITES]) -> f64 {
    ratios.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// A chart of seconds against a ratio up to `top`, with the threshold drawn.
fn chart<'a, 'b>(area: &Area<'b>, caption: &str, what: &str, top: f64) -> Drawn<Drawing<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(caption, ("sans-serif", 15))
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(56)
        .build_cartesian_2d(FIRST_SHOWN as f64..EPOCHS as f64, -0.08 * top..1.05 * top)?;
    chart
        .configure_mesh()
        .x_desc("time (s)")
        .y_desc(what)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .light_line_style(BLACK.mix(0.05))
        .bold_line_style(BLACK.mix(0.12))
        .draw()?;
    let ends = [FIRST_SHOWN as f64, EPOCHS as f64].map(|x| (x, THRESHOLD));
    chart
        .draw_series(DashedLineSeries::new(ends, 6, 4, BLACK.stroke_width(1)))?
        .label(format!("threshold {THRESHOLD}"))
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK));
    Ok(chart)
}

fn draw_ratios(area: &Area, swarm: &Trace) -> Drawn<()> {
    let top = shown(swarm, decision)
        .iter()
        .map(|p| p.1)
        .fold(THRESHOLD, f64::max);
    let caption = "PSO-PF: cumulative ratio of every satellite";
    let mut chart = chart(area, caption, "cumulative LLR", top)?;
    for satellite in (0..SATELLITES).filter(|s| *s != STEPPED) {
        let series = LineSeries::new(shown(swarm, |r| r[satellite]), &SOUND);
        let drawn = chart.draw_series(series)?;
        if satellite == SATELLITES - 1 {
            drawn
                .label("the other eight left out")
                .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], SOUND));
        }
    }
    chart
        .draw_series(LineSeries::new(
            shown(swarm, |r| r[STEPPED]),
            FAULTY.stroke_width(2),
        ))?
        .label("faulty satellite left out")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], FAULTY.stroke_width(2)));
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}

fn draw_decisions(area: &Area, swarm: &Trace, bootstrap: &Trace) -> Drawn<()> {
    let both = [(swarm, FAULTY, "PSO-PF"), (bootstrap, BOOTSTRAP, "PF")];
    let highest = |t: &Trace| {
        shown(t, decision)
            .iter()
            .map(|p| p.1)
            .fold(THRESHOLD, f64::max)
    };
    let top = both
        .iter()
        .map(|(trace, ..)| highest(trace))
        .fold(THRESHOLD, f64::max);
    let mut chart = chart(area, "Decision function", "decision", top)?;
    for (trace, colour, name) in both {
        let series = LineSeries::new(shown(trace, decision), colour.stroke_width(2));
        chart
            .draw_series(series)?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    legend(&mut chart, SeriesLabelPosition::UpperLeft)
}
