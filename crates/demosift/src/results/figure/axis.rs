//! Axes with round ticks.

/// What an axis spans, with its ticks.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Within the span, round numbers.
    pub(super) ticks: Vec<f64>,
    step: f64,
}

/// The lowest and the highest of some numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Span {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Span {
    /// Of all finite ones; `None` of nothing.
    pub(super) fn of(values: impl Iterator<Item = f64>) -> Option<Self> {
        values.filter(|value| value.is_finite()).fold(None, |span: Option<Self>, value| {
            let span = span.unwrap_or(Self { low: value, high: value });
            Some(Self { low: span.low.min(value), high: span.high.max(value) })
        })
    }

    /// With some room at both ends; a single value gets room as well.
    pub(super) fn with_room(self, share: f64) -> Self {
        let width = self.high - self.low;
        let room = if width > 0.0 { width * share } else { self.low.abs().max(1.0) * share };
        Self { low: self.low - room, high: self.high + room }
    }
}

impl Axis {
    /// With about so many ticks, 1, 2 or 5 times a power of ten apart.
    pub(super) fn of(span: Span, about: usize) -> Self {
        let width = if span.high > span.low { span.high - span.low } else { 1.0 };
        let high = span.low + width;
        let raw = width / about.max(1) as f64;
        let power = 10.0_f64.powf(raw.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].map(|round| round * power).into_iter().find(|step| *step >= raw);
        let step = step.unwrap_or(10.0 * power);
        let (first, last) = ((span.low / step).ceil() as i64, (high / step).floor() as i64);
        let ticks = (first..=last).map(|number| number as f64 * step).collect();
        Self { low: span.low, high, ticks, step }
    }

    /// From 0 at the lower end to 1 at the upper.
    pub(super) fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// A tick in words: as many decimals as tell it from its neighbors, thousands and millions short.
    pub(super) fn label(&self, tick: f64) -> String {
        let largest = self.ticks.iter().copied().map(f64::abs).fold(0.0, f64::max);
        let (unit, suffix) = match largest {
            1e6.. => (1e6, "M"),
            1e4.. => (1e3, "k"),
            _ => (1.0, ""),
        };
        let decimals = (-(self.step / unit).log10().floor()).clamp(0.0, 9.0) as usize;
        let number = format!("{:.decimals$}", tick / unit);
        if tick == 0.0 {
            return "0".to_owned();
        }
        let number = number.replacen('-', "−", 1);
        format!("{number}{suffix}")
    }
}
