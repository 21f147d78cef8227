//! Easing functions between two keyframes.

/// An easing function: time fraction to interpolation weight, both 0 to 1.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Easing {
    /// Constant speed: t.
    #[default]
    Linear,
    /// From rest: t^3.
    EaseIn,
    /// To rest: 1 - (1 - t)^3.
    EaseOut,
    /// From rest to rest: t^2 (3 - 2 t).
    EaseInOut,
    /// The previous value until t = 1, then the next.
    Hold,
}

impl Easing {
    /// The interpolation weight at time fraction `t`, 0 to 1; exactly 0 at 0 and 1 at 1.
    pub fn of(self, t: f64) -> f64 {
        match self {
            Easing::Linear => t,
            Easing::EaseIn => t * t * t,
            Easing::EaseOut => {
                let left = 1.0 - t;
                1.0 - left * left * left
            }
            Easing::EaseInOut => t * t * (3.0 - 2.0 * t),
            Easing::Hold => f64::from(u8::from(t >= 1.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_easing_begins_ends_and_never_turns_back() {
        for easing in [Easing::Linear, Easing::EaseIn, Easing::EaseOut, Easing::EaseInOut, Easing::Hold] {
            assert_eq!((easing.of(0.0), easing.of(1.0)), (0.0, 1.0), "{easing:?}");
            let steps: Vec<f64> = (0..=64).map(|i| easing.of(f64::from(i) / 64.0)).collect();
            assert!(steps.windows(2).all(|w| w[0] <= w[1]), "{easing:?}");
        }
        // (1/2)^3, 1 - (1/2)^3, (1/4) * 2.
        let halves = [Easing::EaseIn, Easing::EaseOut, Easing::EaseInOut].map(|easing| easing.of(0.5));
        assert_eq!(halves, [0.125, 0.875, 0.5]);
    }
}
