//! Hatanaka's compression (`Hatanaka2008`, versions 1.0 and 3.0): lines as differences from those of the epoch before.
//!
//! Text is written as what changed, numbers as differences in time of up to the order an arc was
//! begun with (`3&12345`: order 3). Only what is wanted of GPS satellites is followed.

use std::collections::BTreeMap;

use super::header::{Layout, WANTED};

/// Highest order of differences.
const HIGHEST_ORDER: usize = 9;

/// The state of a compressed file.
#[derive(Debug, Default)]
pub(super) struct Compact {
    epoch_line: Vec<u8>,
    satellites: BTreeMap<u8, Satellite>,
    epoch: u64,
}

/// What is remembered of a satellite.
#[derive(Debug, Default)]
struct Satellite {
    /// Epoch it was last seen in.
    epoch: u64,
    arcs: [Arc; WANTED],
    flags: Vec<u8>,
}

/// A number and its differences; without any, an arc has to be begun.
#[derive(Debug, Default, Clone, Copy)]
struct Arc {
    order: usize,
    known: usize,
    differences: [i64; HIGHEST_ORDER + 1],
}

/// A wanted number, in units of 0.001, and its loss-of-lock indicator.
pub(super) type Field = Option<(i64, u8)>;

impl Compact {
    /// The line of an epoch from what the file has in its place. After one in full all satellites begin anew.
    pub(super) fn epoch_line(&mut self, line: &[u8]) -> Result<&[u8], String> {
        match line.first() {
            Some(b'>') => {
                self.epoch_line = line.to_vec();
                self.satellites.clear();
            }
            Some(b'&') => {
                self.epoch_line = line.to_vec();
                self.epoch_line[0] = b' ';
                self.satellites.clear();
            }
            _ if self.epoch_line.is_empty() => {
                return Err("the first epoch is not written in full".to_owned());
            }
            _ => patch(&mut self.epoch_line, line),
        }
        self.epoch += 1;
        Ok(&self.epoch_line)
    }

    /// The line of the epoch read last, in full.
    pub(super) fn epoch_text(&self) -> &[u8] {
        &self.epoch_line
    }

    /// The wanted observables of GPS satellite `prn` from its line.
    pub(super) fn satellite(
        &mut self,
        prn: u8,
        line: &[u8],
        layout: &Layout,
    ) -> Result<[Field; WANTED], String> {
        let satellite = self.satellites.entry(prn).or_default();
        if satellite.epoch + 1 != self.epoch {
            *satellite = Satellite::default();
        }
        satellite.epoch = self.epoch;
        satellite.read(line, layout)
    }
}

impl Satellite {
    fn read(&mut self, line: &[u8], layout: &Layout) -> Result<[Field; WANTED], String> {
        let mut rest = line;
        for place in 0..layout.count {
            let end = rest.iter().position(|b| *b == b' ');
            let field = &rest[..end.unwrap_or(rest.len())];
            rest = end.map_or(&[][..], |end| &rest[end + 1..]);
            if let Some(which) = layout.places.iter().position(|p| *p == Some(place)) {
                self.arcs[which].take(field)?;
            }
        }
        patch(&mut self.flags, rest);
        Ok(std::array::from_fn(|which| {
            let place = layout.places[which]?;
            let flag = self.flags.get(2 * place).copied().unwrap_or(b' ');
            self.arcs[which].value().map(|value| (value, flag))
        }))
    }
}

impl Arc {
    fn value(&self) -> Option<i64> {
        (self.known > 0).then_some(self.differences[0])
    }

    /// Takes a field: nothing, the beginning of an arc, or a difference.
    fn take(&mut self, field: &[u8]) -> Result<(), String> {
        let wrong = |expected: &str| {
            let found = crate::rinex_text::shown(field);
            Err(format!("difference '{found}': expected {expected}"))
        };
        let integer = |text: &[u8]| std::str::from_utf8(text).ok()?.parse::<i64>().ok();
        match field {
            [] => *self = Self::default(),
            [order @ b'0'..=b'9', b'&', value @ ..] => {
                let Some(value) = integer(value) else {
                    return wrong("a whole number after &");
                };
                *self = Self {
                    order: usize::from(order - b'0'),
                    known: 1,
                    differences: [0; HIGHEST_ORDER + 1],
                };
                self.differences[0] = value;
            }
            _ => {
                let Some(difference) = integer(field).filter(|_| self.known > 0) else {
                    return wrong("a whole number, and an arc that was begun");
                };
                if self.add(difference).is_none() {
                    return wrong("numbers that do not overflow");
                }
            }
        }
        Ok(())
    }

    fn add(&mut self, difference: i64) -> Option<()> {
        if self.known <= self.order {
            self.known += 1;
        }
        let last = self.known - 1;
        self.differences[last] = difference;
        if last == 0 {
            // Order zero: each value stands for itself.
            return Some(());
        }
        for k in (0..last).rev() {
            self.differences[k] = self.differences[k].checked_add(self.differences[k + 1])?;
        }
        Some(())
    }
}

/// Changes `text` by `difference`: a blank keeps a character, `&` makes it a blank.
fn patch(text: &mut Vec<u8>, difference: &[u8]) {
    for (at, &byte) in difference.iter().enumerate() {
        let new = if byte == b'&' { b' ' } else { byte };
        match text.get_mut(at) {
            Some(_) if byte == b' ' => {}
            Some(old) => *old = new,
            None => text.push(new),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_keeps_blanks_and_replaces_the_rest() {
        let mut text = b"abc de".to_vec();
        patch(&mut text, b" x&  f g");
        assert_eq!(text, b"ax  df g");
    }

    #[test]
    fn third_differences_give_a_cubic_back() {
        let cubic = |t: i64| 7 * t * t * t - 3 * t * t + 11 * t - 5;
        let mut arc = Arc::default();
        arc.take(format!("3&{}", cubic(0)).as_bytes()).unwrap();
        // Differences as they are written: of order 1, 2, then 3, which is 6 x 7 for a cubic.
        let first = |t: i64| cubic(t) - cubic(t - 1);
        let second = |t: i64| first(t) - first(t - 1);
        let third = |t: i64| second(t) - second(t - 1);
        for t in 1..20 {
            let difference = match t {
                1 => first(1),
                2 => second(2),
                _ => third(t),
            };
            arc.take(difference.to_string().as_bytes()).unwrap();
            assert_eq!(arc.value(), Some(cubic(t)));
        }
    }

    #[test]
    fn a_missing_number_ends_its_arc() {
        let mut arc = Arc::default();
        assert!(arc.take(b"5").is_err());
        arc.take(b"1&100").unwrap();
        arc.take(b"").unwrap();
        assert_eq!(arc.value(), None);
        assert!(arc.take(b"5").is_err());
        arc.take(format!("0&{}", i64::MAX).as_bytes()).unwrap();
        arc.take(b"7").unwrap();
        assert_eq!(arc.value(), Some(7));
        arc.take(format!("1&{}", i64::MAX).as_bytes()).unwrap();
        assert!(arc.take(b"1").is_err());
    }

    #[test]
    fn an_epoch_in_full_begins_every_satellite_anew() {
        let layout = Layout {
            places: [Some(0), None, None, None],
            count: 1,
        };
        let mut compact = Compact::default();
        let mut read = |epoch: &[u8], line: &[u8]| {
            compact.epoch_line(epoch).unwrap();
            compact.satellite(7, line, &layout)
        };
        // Loss of lock is written once and stands until it is replaced.
        assert_eq!(read(b"> 1", b"1&100 1").unwrap()[0], Some((100, b'1')));
        assert_eq!(read(b"  2", b"5").unwrap()[0], Some((105, b'1')));
        assert_eq!(read(b"> 3", b"1&110").unwrap()[0], Some((110, b' ')));
        assert!(read(b"> 4", b"5").is_err(), "no arc was begun");
    }
}
