//! Sizes of a two-dimensional convolution.

/// Shape of a convolution: NCHW input, OIHW weights, zero padding, as `torch.nn.Conv2d` has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Geometry {
    /// Images, channels of one group, height, width.
    pub(crate) input: [usize; 4],
    /// Output channels of one group.
    pub(crate) n_out: usize,
    /// Height and width of the kernel.
    pub(crate) kernel: [usize; 2],
    /// Rows and columns from one output to the next.
    pub(crate) stride: [usize; 2],
    /// Zeros above and left of the input.
    pub(crate) before: [usize; 2],
    /// Zeros below and right of the input.
    pub(crate) after: [usize; 2],
    /// Rows and columns between kernel elements.
    pub(crate) dilation: [usize; 2],
}

impl Geometry {
    /// Height and width of the output; `None` if the kernel does not fit into the padded input.
    pub(crate) fn output(&self) -> Option<[usize; 2]> {
        let side = |axis: usize| {
            let padded = self.input[2 + axis] + self.before[axis] + self.after[axis];
            let reach = self.dilation[axis] * (self.kernel[axis] - 1) + 1;
            Some(padded.checked_sub(reach)? / self.stride[axis] + 1)
        };
        Some([side(0)?, side(1)?])
    }

    /// Number of terms in one output: channels times kernel elements.
    pub(crate) fn depth(&self) -> usize {
        self.input[1] * self.kernel[0] * self.kernel[1]
    }
}
