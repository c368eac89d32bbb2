//! What is done to a convolution's sums before they are stored: scale, shift, residual, activation.

use super::multiply::Lanes;

/// Last step of a layer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Activation {
    /// `x`.
    #[default]
    None,
    /// `max(x, 0)`.
    Relu,
    /// `min(max(x, 0), 6)`.
    Relu6,
}

/// `activation(scale · sum + shift + residual)`, per output channel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish<'a> {
    /// Factor per output channel; none is 1.
    pub(crate) scale: Option<&'a [f32]>,
    /// Term per output channel; none is 0.
    pub(crate) shift: Option<&'a [f32]>,
    /// Tensor of the output's shape that is added.
    pub(crate) residual: Option<&'a [f32]>,
    /// Last step.
    pub(crate) activation: Activation,
}

impl Finish<'_> {
    /// Finishes up to 16 sums of one channel; `at` is where `out` lies in the whole output.
    #[inline(always)]
    #[expect(clippy::inline_always, reason = "compiled for the registers of the caller")]
    pub(super) fn store(&self, channel: usize, sums: &Lanes, at: usize, out: &mut [f32]) {
        let scale = self.scale.map_or(1.0, |it| it[channel]);
        let shift = self.shift.map_or(0.0, |it| it[channel]);
        let mut values = *sums;
        for value in &mut values {
            *value = *value * scale + shift;
        }
        if let Some(residual) = self.residual {
            let residual = &residual[at..at + out.len()];
            if let Ok(residual) = <&Lanes>::try_from(residual) {
                values.iter_mut().zip(residual).for_each(|(value, residual)| *value += residual);
            } else {
                values.iter_mut().zip(residual).for_each(|(value, residual)| *value += residual);
            }
        }
        match self.activation {
            Activation::None => {}
            Activation::Relu => values.iter_mut().for_each(|it| *it = it.max(0.0)),
            Activation::Relu6 => values.iter_mut().for_each(|it| *it = it.clamp(0.0, 6.0)),
        }
        // Of known length, it is one store and no call.
        if let Ok(out) = <&mut Lanes>::try_from(&mut *out) {
            *out = values;
        } else {
            out.copy_from_slice(&values[..out.len()]);
        }
    }
}
