//! Blocks in order, made on one thread or several.
//!
//! One thread plans, for emitters are asked in order; it queues every block for the threads that
//! make samples, and for the reader the place where its result will appear. Both queues are short,
//! so that memory is bounded and nobody runs far ahead.

use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::Builder;

use anyhow::{Context, Result};

use super::front_end::Bench;
use super::plan::{Planner, Run};
use super::synthesiser::{Made, Receiving};

/// Blocks under way for each thread.
const AHEAD: usize = 3;

/// Where blocks come from.
pub(super) enum Supply {
    /// Made when asked for.
    Here {
        planner: Box<Planner>,
        receiving: Arc<Receiving>,
        bench: Box<Bench>,
    },
    /// Made ahead. The threads end when this is dropped or all is made.
    Threads(Receiver<Pending>),
}

/// A block that is planned: where it will appear, or why it cannot be made.
type Pending = Result<Receiver<Made>>;

/// A planned block, and where to put it.
type Job = (Vec<Run>, Sender<Made>);

impl Supply {
    /// Blocks of `planner`.
    ///
    /// # Errors
    /// Where a thread cannot be started.
    pub(super) fn new(
        planner: Planner,
        receiving: &Arc<Receiving>,
        threads: usize,
    ) -> Result<Self> {
        if threads <= 1 {
            return Ok(Self::Here {
                planner: Box::new(planner),
                receiving: Arc::clone(receiving),
                bench: Box::new(receiving.bench()),
            });
        }
        let (pending, in_order) = sync_channel(AHEAD * threads);
        let (jobs, queue) = sync_channel(AHEAD * threads);
        let queue = Arc::new(Mutex::new(queue));
        let spawn = |name: &str, work: Box<dyn FnOnce() + Send>| {
            let started = Builder::new().name(name.to_owned()).spawn(work);
            started.context("a thread to make samples")
        };
        spawn("plan", Box::new(move || plan(planner, &jobs, &pending)))?;
        for _ in 0..threads {
            let (queue, receiving) = (Arc::clone(&queue), Arc::clone(receiving));
            spawn("samples", Box::new(move || make(&queue, &receiving)))?;
        }
        Ok(Self::Threads(in_order))
    }

    /// The next block; none at the end.
    ///
    /// # Errors
    /// Where it cannot be made.
    pub(super) fn next(&mut self) -> Result<Option<Made>> {
        match self {
            Self::Here {
                planner,
                receiving,
                bench,
            } => Ok(planner
                .next_block()?
                .map(|runs| receiving.make(runs, bench))),
            Self::Threads(in_order) => {
                // A closed queue is the end.
                let Ok(pending) = in_order.recv() else {
                    return Ok(None);
                };
                let made = pending?
                    .recv()
                    .context("a thread that makes samples ended")?;
                Ok(Some(made))
            }
        }
    }
}

/// Plans until the end, the first error, or nobody listens.
fn plan(mut planner: Planner, jobs: &SyncSender<Job>, pending: &SyncSender<Pending>) {
    loop {
        let runs = match planner.next_block() {
            Ok(Some(runs)) => runs,
            Ok(None) => return,
            Err(error) => {
                // The reader may be gone.
                let _ = pending.send(Err(error));
                return;
            }
        };
        let (made, place) = channel();
        if pending.send(Ok(place)).is_err() || jobs.send((runs, made)).is_err() {
            return;
        }
    }
}

/// Makes blocks until there are no more.
fn make(queue: &Mutex<Receiver<Job>>, receiving: &Receiving) {
    let mut bench = receiving.bench();
    loop {
        // Another thread that panicked while it held the queue left it whole.
        let job = queue
            .lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .recv();
        let Ok((runs, made)) = job else { return };
        // The reader may be gone.
        let _ = made.send(receiving.make(runs, &mut bench));
    }
}
