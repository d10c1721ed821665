//! Values over time in bounded memory.

/// Most buckets a series keeps: about two for each pixel column that matters.
const MOST_BUCKETS: usize = 400;

/// Neighbouring values of a [`Series`], reduced to mean and extremes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Bucket {
    pub(super) start_s: f64,
    pub(super) end_s: f64,
    pub(super) least: f64,
    pub(super) most: f64,
    sum: f64,
    count: u32,
}

impl Bucket {
    fn of(time_s: f64, value: f64) -> Self {
        Self {
            start_s: time_s,
            end_s: time_s,
            least: value,
            most: value,
            sum: value,
            count: 1,
        }
    }

    fn join(&mut self, other: &Self) {
        self.end_s = other.end_s;
        self.least = self.least.min(other.least);
        self.most = self.most.max(other.most);
        self.sum += other.sum;
        self.count += other.count;
    }

    pub(super) fn mean(&self) -> f64 {
        self.sum / f64::from(self.count)
    }

    pub(super) fn middle_s(&self) -> f64 {
        0.5 * (self.start_s + self.end_s)
    }
}

/// Values over time. When too many have come, neighbours are joined: the mean coarsens, but no
/// extreme is ever lost.
#[derive(Debug, Clone)]
pub(super) struct Series {
    buckets: Vec<Bucket>,
    values_per_bucket: u32,
}

impl Default for Series {
    fn default() -> Self {
        Self {
            buckets: Vec::new(),
            values_per_bucket: 1,
        }
    }
}

impl Series {
    /// Adds a value; times must not decrease. What is not finite is left out.
    pub(super) fn push(&mut self, time_s: f64, value: f64) {
        if !value.is_finite() {
            return;
        }
        let new = Bucket::of(time_s, value);
        match self.buckets.last_mut() {
            Some(last) if last.count < self.values_per_bucket => last.join(&new),
            _ => self.buckets.push(new),
        }
        if self.buckets.len() > MOST_BUCKETS {
            self.halve();
        }
    }

    pub(super) fn buckets(&self) -> &[Bucket] {
        &self.buckets
    }

    fn halve(&mut self) {
        let pairs = self.buckets.chunks(2).map(|pair| {
            let mut joined = pair[0];
            if let Some(second) = pair.get(1) {
                joined.join(second);
            }
            joined
        });
        self.buckets = pairs.collect();
        self.values_per_bucket *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_bounded_and_outliers_survive() {
        let mut series = Series::default();
        for i in 0..100_000 {
            let value = if i == 54_321 { 99.0 } else { f64::from(i % 2) };
            series.push(f64::from(i), value);
        }
        series.push(100_000.0, f64::NAN);
        assert!(series.buckets().len() <= MOST_BUCKETS);
        assert!(series.buckets().len() > MOST_BUCKETS / 3);
        assert!(series.buckets().iter().any(|bucket| bucket.most == 99.0));
        assert_eq!(series.buckets()[0].mean(), 0.5);
        let total: u32 = series.buckets().iter().map(|bucket| bucket.count).sum();
        assert_eq!(total, 100_000);
    }
}
