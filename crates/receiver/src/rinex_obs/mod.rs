//! Observations of GPS L1 C/A from RINEX 2 and 3 observation files: plain, compressed by
//! Hatanaka's method, by gzip, or by both.
//!
//! Read epoch by epoch in bounded memory, by columns. Satellites of other systems are passed over;
//! nothing is rounded. The `rinex` crate, which reads every field of every system, is what the
//! tests hold it against.

mod compact;
mod epoch;
mod header;
mod plain;
#[cfg(test)]
mod tests;

use std::io::BufRead;
use std::path::{Path, PathBuf};

use gnss_nav::{GpsTime, SatelliteId};

use crate::ReceiverError;
use crate::lines::Lines;
use crate::rinex_text::{Failure, number, shown};
use compact::{Compact, Field};
use epoch::{EpochHead, Kind, list_column};
use header::{Reading, WANTED};

pub use header::ObservationHeader;

/// What was observed of one satellite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedSatellite {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Pseudorange, m.
    pub pseudorange_m: f64,
    /// Carrier phase, cycles, which grows with the range.
    pub phase_cycles: Option<f64>,
    /// Loss-of-lock indicator of the phase: bit 0 lock lost, bit 1 half a cycle open.
    pub loss_of_lock: u8,
    /// Doppler, Hz; positive when approaching.
    pub doppler_hz: Option<f64>,
    /// Signal strength, dB-Hz.
    pub cn0_dbhz: Option<f64>,
}

/// What was observed at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedEpoch {
    /// Time of the epoch by the receiver's clock.
    pub time: GpsTime,
    /// Line of the file it begins in.
    pub line: u64,
    /// GPS satellites with a pseudorange on L1 C/A, each once, in order.
    pub satellites: Vec<ObservedSatellite>,
    /// Satellites of any system that the epoch announces and does not hold.
    pub missing: usize,
}

/// Reads an observation file epoch by epoch; after an error it is at its end.
pub struct ObservationReader {
    path: PathBuf,
    lines: Lines,
    header: ObservationHeader,
    compact: Option<Compact>,
    ended: bool,
}

impl ObservationReader {
    /// Opens the file at `path` and reads its header.
    ///
    /// # Errors
    /// [`ReceiverError::File`] where it cannot be read; [`ReceiverError::Content`], naming the
    /// line, where it is no RINEX 2 or 3 observation file with GPS L1 C/A.
    pub fn open(path: &Path) -> Result<Self, ReceiverError> {
        let lines = Lines::open(path).map_err(|source| ReceiverError::File {
            path: path.to_owned(),
            source,
        })?;
        Self::start(path, lines)
    }

    /// The same of uncompressed text from anywhere; `name` stands for it in errors.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn new(name: &Path, text: Box<dyn BufRead>) -> Result<Self, ReceiverError> {
        Self::start(name, Lines::new(text))
    }

    fn start(path: &Path, mut lines: Lines) -> Result<Self, ReceiverError> {
        let header = header::read(&mut lines).map_err(|failure| failure.of(path))?;
        Ok(Self {
            path: path.to_owned(),
            lines,
            compact: header.compression.map(|_| Compact::default()),
            header,
            ended: false,
        })
    }

    /// The header.
    #[must_use]
    pub const fn header(&self) -> &ObservationHeader {
        &self.header
    }

    fn next_epoch(&mut self) -> Result<Option<ObservedEpoch>, Failure> {
        loop {
            if !self.lines.advance()? {
                return Ok(None);
            }
            if self.lines.current().is_empty() && self.compact.is_none() {
                continue;
            }
            let line = self.lines.number();
            let head = self.head()?;
            match head.kind {
                Kind::Observations(time) => {
                    let (satellites, missing) = self.satellites(head.count)?;
                    return Ok(Some(ObservedEpoch {
                        time,
                        line,
                        satellites,
                        missing,
                    }));
                }
                Kind::Lines => self.header_lines(head.count)?,
                Kind::Slips => {
                    self.satellites(head.count)?;
                }
            }
        }
    }

    fn head(&mut self) -> Result<EpochHead, Failure> {
        let Self { lines, compact, .. } = self;
        let text = match compact {
            Some(compact) => compact
                .epoch_line(lines.current())
                .map_err(|what| Failure::at(lines, what))?,
            None => lines.current(),
        };
        epoch::parse(lines, text, self.header.version)
    }

    fn header_lines(&mut self, count: usize) -> Result<(), Failure> {
        let mut reading = Reading::default();
        for _ in 0..count {
            self.advance()?;
            reading.line(&self.lines, &mut self.header)?;
        }
        Ok(())
    }

    /// Reads the next line, which has to be there.
    fn advance(&mut self) -> Result<(), Failure> {
        if self.lines.advance()? {
            return Ok(());
        }
        Err(Failure::at(
            &self.lines,
            "the file ends within an epoch".to_owned(),
        ))
    }

    /// The satellites of an epoch that announces `count`, and how many are missing.
    fn satellites(&mut self, count: usize) -> Result<(Vec<ObservedSatellite>, usize), Failure> {
        let mut satellites = Vec::with_capacity(count.min(16));
        let mut missing = 0;
        if self.compact.is_some() {
            self.compact_satellites(count, &mut satellites)?;
        } else if self.header.version == 2 {
            self.satellites_2(count, &mut satellites)?;
        } else {
            missing = self.satellites_3(count, &mut satellites)?;
        }
        satellites.sort_unstable_by_key(|s| s.satellite);
        if let Some(pair) = satellites
            .windows(2)
            .find(|pair| pair[0].satellite == pair[1].satellite)
        {
            let what = format!("{} twice in one epoch: expected once", pair[0].satellite);
            return Err(Failure::at(&self.lines, what));
        }
        Ok((satellites, missing))
    }

    fn compact_satellites(
        &mut self,
        count: usize,
        found: &mut Vec<ObservedSatellite>,
    ) -> Result<(), Failure> {
        // The receiver's clock offset, of no use here.
        self.advance()?;
        let start = list_column(self.header.version);
        for index in 0..count {
            self.advance()?;
            let Some(compact) = &self.compact else {
                continue;
            };
            let list = compact.epoch_text();
            let Some(satellite) = self.id(list.get(start + 3 * index..).unwrap_or_default())?
            else {
                continue;
            };
            let Self { lines, compact, .. } = self;
            let Some(compact) = compact else { continue };
            let fields = compact
                .satellite(satellite.prn, lines.current(), &self.header.layout)
                .map_err(|what| Failure::at(lines, format!("{satellite}: {what}")))?;
            let scaled = fields.map(|field: Field| {
                field.map(|(thousandths, flag)| (thousandths as f64 / 1e3, flag))
            });
            found.extend(observed(satellite, &scaled));
        }
        Ok(())
    }

    /// The satellite that `text` begins with; none of another system.
    fn id(&self, text: &[u8]) -> Result<Option<SatelliteId>, Failure> {
        let system = match text.first() {
            // Version 2 leaves the system out where there is GPS alone.
            Some(b' ') if self.header.version == 2 => b'G',
            Some(&letter) if letter.is_ascii_uppercase() => letter,
            _ => return Err(self.no_satellite(text)),
        };
        if system != b'G' {
            return Ok(None);
        }
        match number(text, 1, 3) {
            Some(prn @ 1..=63) => Ok(Some(SatelliteId::gps(prn))),
            _ => Err(self.no_satellite(text)),
        }
    }

    fn no_satellite(&self, text: &[u8]) -> Failure {
        let found = shown(text.get(..3).unwrap_or(text));
        Failure::at(
            &self.lines,
            format!("'{found}': expected a satellite, for instance G07"),
        )
    }
}

impl Iterator for ObservationReader {
    type Item = Result<ObservedEpoch, ReceiverError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ended {
            return None;
        }
        let epoch = self.next_epoch().map_err(|failure| failure.of(&self.path));
        self.ended = !matches!(epoch, Ok(Some(_)));
        epoch.transpose()
    }
}

/// An observation, where there is a pseudorange: zero, like blank, means none.
fn observed(
    satellite: SatelliteId,
    fields: &[Option<(f64, u8)>; WANTED],
) -> Option<ObservedSatellite> {
    let [code, phase, doppler, strength] = fields.map(|f| f.filter(|(value, _)| *value != 0.0));
    Some(ObservedSatellite {
        satellite,
        pseudorange_m: code?.0,
        phase_cycles: phase.map(|p| p.0),
        loss_of_lock: phase.map_or(0, |(_, flag)| match flag {
            b'0'..=b'7' => flag - b'0',
            _ => 0,
        }),
        doppler_hz: doppler.map(|d| d.0),
        cn0_dbhz: strength.map(|s| s.0),
    })
}
