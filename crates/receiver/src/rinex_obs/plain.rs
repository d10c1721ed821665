//! Observations as they are written uncompressed: numbers in columns.

use super::epoch::list_column;
use super::header::WANTED;
use super::{ObservationReader, ObservedSatellite, observed};
use crate::rinex_text::{Failure, columns, number, shown};

/// Place of the signal strength among the wanted observables.
const STRENGTH: usize = 3;

impl ObservationReader {
    /// Version 2: the list of satellites first, twelve a line, then five observables a line.
    pub(super) fn satellites_2(
        &mut self,
        count: usize,
        found: &mut Vec<ObservedSatellite>,
    ) -> Result<(), Failure> {
        let start = list_column(2);
        let mut list = Vec::with_capacity(count.min(64));
        for index in 0..count {
            if index > 0 && index % 12 == 0 {
                self.advance()?;
            }
            let at = start + 3 * (index % 12);
            list.push(self.id(self.lines.current().get(at..).unwrap_or_default())?);
        }
        let lines_each = self.header.layout.count.div_ceil(5);
        let mut text = vec![Vec::new(); lines_each];
        for satellite in list {
            for line in &mut text {
                self.advance()?;
                line.clear();
                line.extend_from_slice(self.lines.current());
            }
            if let Some(satellite) = satellite {
                let line = |place: usize| text.get(place / 5).map_or(&[][..], Vec::as_slice);
                let fields = self.plain_fields(|place| (line(place), 16 * (place % 5)))?;
                found.extend(observed(satellite, &fields));
            }
        }
        Ok(())
    }

    /// Version 3: a line each. Some writers announce more than they write: an epoch ends where the
    /// next begins, or with the file.
    pub(super) fn satellites_3(
        &mut self,
        count: usize,
        found: &mut Vec<ObservedSatellite>,
    ) -> Result<usize, Failure> {
        for index in 0..count {
            if !self.lines.advance()? {
                return Ok(count - index);
            }
            let line = self.lines.current();
            if line.first() == Some(&b'>') {
                self.lines.hold();
                return Ok(count - index);
            }
            if let Some(satellite) = self.id(line)? {
                let fields = self.plain_fields(|place| (line, 3 + 16 * place))?;
                found.extend(observed(satellite, &fields));
            }
        }
        Ok(0)
    }

    /// The wanted fields of a satellite; `find` gives the line and column of an observable.
    fn plain_fields<'a>(
        &self,
        find: impl Fn(usize) -> (&'a [u8], usize),
    ) -> Result<[Option<(f64, u8)>; WANTED], Failure> {
        let mut fields = [None; WANTED];
        for (which, (field, place)) in fields.iter_mut().zip(self.header.layout.places).enumerate()
        {
            if let Some(place) = place {
                let (line, column) = find(place);
                // Strengths are written in other formats too.
                let is_exact = which != STRENGTH;
                *field = self.plain_field(line, column, is_exact)?;
            }
        }
        Ok(fields)
    }

    /// A number of 14 columns with three decimals and its indicator. A point that stands elsewhere
    /// means columns that are shifted, or a line that is cut off within a number.
    fn plain_field(
        &self,
        line: &[u8],
        column: usize,
        is_exact: bool,
    ) -> Result<Option<(f64, u8)>, Failure> {
        let text = columns(line, column, column + 14);
        if text.is_empty() {
            return Ok(None);
        }
        let point = line.get(column + 10) == Some(&b'.') && line.len() >= column + 14;
        let value = number(line, column, column + 14)
            .filter(|v: &f64| v.is_finite() && (point || !is_exact));
        let Some(value) = value else {
            let found = shown(
                line.get(column..)
                    .unwrap_or_default()
                    .get(..14)
                    .unwrap_or(text),
            );
            return Err(Failure::at(
                &self.lines,
                format!(
                    "'{found}' in columns {} to {}: expected a number with three decimals",
                    column + 1,
                    column + 14
                ),
            ));
        };
        Ok(Some((
            value,
            line.get(column + 14).copied().unwrap_or(b' '),
        )))
    }
}
