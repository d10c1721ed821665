//! A stream of samples made from a scene.

use std::io;
use std::num::NonZeroUsize;
use std::sync::Arc;

use anyhow::Result;
use gnss_signal::sample::{SampleDescription, SampleSource};

use super::front_end::{Bench, FrontEnd};
use super::gain::GainControl;
use super::grid::Grid;
use super::plan::{Planner, Run};
use super::planes::Planes;
use super::quantise::Quantiser;
use super::supply::Supply;
use crate::scenario::antenna::{Emitter, Ray, Scene};

/// Whether there is thermal noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ThermalNoise {
    /// White, at the density that C/N0 counts against.
    #[default]
    White,
    /// None, at the level that samples would have with it.
    Absent,
}

/// How a scene is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// Threads that make samples; none: as many as the machine has. One makes them in
    /// [`SampleSource::read`], on the thread that asks. The bytes are the same.
    pub threads: Option<NonZeroUsize>,
    /// Thermal noise.
    pub thermal_noise: ThermalNoise,
}

/// Makes the samples of a [`Scene`], a block of at most 2 ms at a time, a few blocks ahead.
///
/// The same scene gives the same bytes, however they are read, on any number of threads and any
/// instruction set.
pub struct Synthesiser {
    description: SampleDescription,
    supply: Supply,
    receiving: Arc<Receiving>,
    gain: GainControl,
    /// Components that do not fill a byte yet.
    components: Vec<f32>,
    bytes: Vec<u8>,
    taken: usize,
}

/// Front end and quantiser, which all threads share.
pub(super) struct Receiving {
    front_end: FrontEnd,
    quantiser: Quantiser,
    description: SampleDescription,
    gain: GainControl,
}

/// What a thread makes of a block.
pub(super) enum Made {
    /// Bytes to hand out.
    Bytes(Vec<u8>),
    /// Samples that wait for their gain.
    Samples(Vec<(Run, Planes)>),
}

impl Synthesiser {
    /// A synthesiser at the first sample of `scene`, on all threads of the machine.
    ///
    /// # Errors
    /// Where a value of the scene is impossible.
    pub fn new(scene: Scene) -> Result<Self> {
        Self::with_options(scene, Options::default())
    }

    /// A synthesiser at the first sample of `scene`.
    ///
    /// # Errors
    /// Where a value of the scene is impossible.
    pub fn with_options(scene: Scene, options: Options) -> Result<Self> {
        scene.check()?;
        let length_ticks = scene.length_ticks();
        let Scene {
            reception,
            mut emitters,
            interference,
            gaps,
            seed,
            ..
        } = scene;
        let description = reception.samples;
        let grid = Grid {
            sample_rate_hz: description.sample_rate_hz,
        };
        let front_end = FrontEnd::new(&reception, interference, seed, options.thermal_noise)?;
        let rms = front_end.rms(cn0_sum_hz(&mut emitters)?);
        let gain = GainControl::new(reception.gain, rms, description.sample_rate_hz);
        let planner = Planner::new(emitters, &gaps, grid, length_ticks, gain.follows())?;
        let receiving = Arc::new(Receiving {
            front_end,
            quantiser: Quantiser::new(description.format, reception.bits)?,
            description,
            gain: gain.clone(),
        });
        let threads = options
            .threads
            .or(std::thread::available_parallelism().ok());
        Ok(Self {
            description,
            supply: Supply::new(planner, &receiving, threads.map_or(1, NonZeroUsize::get))?,
            receiving,
            gain,
            components: Vec::new(),
            bytes: Vec::new(),
            taken: 0,
        })
    }

    /// Gets the bytes of the next block that has any; none at the end.
    fn next_block(&mut self) -> Result<()> {
        self.bytes.clear();
        self.taken = 0;
        while self.bytes.is_empty() {
            match self.supply.next()? {
                Some(Made::Bytes(bytes)) => self.bytes = bytes,
                Some(Made::Samples(runs)) => self.level(runs),
                None => {
                    let rest = std::mem::take(&mut self.components);
                    self.receiving.quantiser.append(&rest, &mut self.bytes);
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Brings samples that waited for their gain to their level; whole bytes become bytes.
    fn level(&mut self, runs: Vec<(Run, Planes)>) {
        for (run, mut planes) in runs {
            let components = &mut self.components;
            self.receiving
                .finish(&mut self.gain, &run, &mut planes, components);
        }
        // Eight components of any depth fill bytes.
        let whole = self.components.len() / 8 * 8;
        let full: Vec<f32> = self.components.drain(..whole).collect();
        self.receiving.quantiser.append(&full, &mut self.bytes);
    }
}

impl Receiving {
    pub(super) fn bench(&self) -> Bench {
        self.front_end.bench()
    }

    /// Makes a block.
    pub(super) fn make(&self, runs: Vec<Run>, bench: &mut Bench) -> Made {
        let mut gain = self.gain.clone();
        let mut waiting = Vec::new();
        bench.components.clear();
        for run in runs {
            let mut planes = std::mem::take(&mut bench.received);
            self.front_end
                .receive(&run.segments, run.tick, run.samples, bench, &mut planes);
            if gain.follows() {
                waiting.push((run, planes));
            } else {
                self.finish(&mut gain, &run, &mut planes, &mut bench.components);
                bench.received = planes;
            }
        }
        if gain.follows() {
            return Made::Samples(waiting);
        }
        let mut bytes = Vec::new();
        self.quantiser.append(&bench.components, &mut bytes);
        Made::Bytes(bytes)
    }

    /// Brings samples to their level and appends the components of those delivered.
    fn finish(
        &self,
        gain: &mut GainControl,
        run: &Run,
        planes: &mut Planes,
        components: &mut Vec<f32>,
    ) {
        let complex = self.description.format.is_complex();
        gain.apply(run.tick, run.samples, complex, planes);
        if !run.delivered {
            return;
        }
        let (mut i, mut q) = (&planes.i[..run.samples], &planes.q[..run.samples]);
        if self.description.swap_iq {
            (i, q) = (q, i);
        }
        if complex {
            let start = components.len();
            components.resize(start + 2 * run.samples, 0.0);
            let pairs = components[start..].as_chunks_mut().0.iter_mut();
            for (pair, (i, q)) in pairs.zip(i.iter().zip(q)) {
                *pair = [*i, *q];
            }
        } else {
            components.extend_from_slice(i);
        }
    }
}

/// Sum of C/N0 (Hz) over the rays at the first sample.
fn cn0_sum_hz(emitters: &mut [Box<dyn Emitter>]) -> Result<f64> {
    let mut rays: Vec<Ray> = Vec::new();
    for emitter in emitters {
        // After the edges that are at the first sample.
        emitter.rays(0.0, 1e-9, &mut rays)?;
    }
    Ok(rays.iter().map(|ray| ray.amplitude.powi(2)).sum())
}

impl SampleSource for Synthesiser {
    fn description(&self) -> SampleDescription {
        self.description
    }

    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.taken == self.bytes.len() {
            self.next_block().map_err(io::Error::other)?;
        }
        let ready = &self.bytes[self.taken..];
        let len = ready.len().min(bytes.len());
        bytes[..len].copy_from_slice(&ready[..len]);
        self.taken += len;
        Ok(len)
    }
}
