//! The last steps of a channel, oldest first, without moving them.

/// Scaled features of the last steps.
#[derive(Debug, Clone, PartialEq)]
pub struct SlidingWindow {
    /// Twice the window: it moves along and is copied back once in a window's length, so that the steps
    /// always lie in one piece.
    values: Vec<f32>,
    width: usize,
    length: usize,
    begin: usize,
    held: usize,
}

impl SlidingWindow {
    /// Empty; holds `length` steps of `width` features each, at least one.
    #[must_use]
    pub fn new(length: usize, width: usize) -> Self {
        let length = length.max(1);
        Self {
            values: vec![0.0; 2 * length * width],
            width,
            length,
            begin: 0,
            held: 0,
        }
    }

    /// Takes the next step's features; more or fewer than the width are cut or left zero.
    pub fn push(&mut self, features: impl Iterator<Item = f32>) {
        if self.held == self.length {
            self.begin += 1;
            self.held -= 1;
        }
        if self.begin + self.held == 2 * self.length {
            let from = self.begin * self.width;
            self.values.copy_within(from.., 0);
            self.begin = 0;
        }
        let at = (self.begin + self.held) * self.width;
        let slots = self.values.iter_mut().skip(at).take(self.width);
        for (slot, value) in slots.zip(features.chain(std::iter::repeat(0.0))) {
            *slot = value;
        }
        self.held += 1;
    }

    /// Steps still needed before the window is full.
    #[must_use]
    pub const fn missing(&self) -> usize {
        self.length - self.held
    }

    /// All steps one after the other, oldest first.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        let begin = self.begin * self.width;
        let end = begin + self.held * self.width;
        self.values.get(begin..end).unwrap_or(&[])
    }

    /// Forgets everything.
    pub const fn clear(&mut self) {
        self.begin = 0;
        self.held = 0;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn it_holds_the_last_steps_in_order(
            steps in prop::collection::vec(-9.0..9.0f32, 0..60), length in 1usize..9
        ) {
            let mut window = SlidingWindow::new(length, 2);
            for k in 0..steps.len() {
                window.push([steps[k], -steps[k]].into_iter());
                let first = (k + 1).saturating_sub(length);
                let expected: Vec<f32> = steps[first..=k].iter().flat_map(|s| [*s, -s]).collect();
                prop_assert_eq!(window.values(), &expected[..]);
                prop_assert_eq!(window.missing(), length - (k + 1 - first));
            }
            window.clear();
            prop_assert_eq!(window.missing(), length);
            prop_assert!(window.values().is_empty());
        }
    }
}
