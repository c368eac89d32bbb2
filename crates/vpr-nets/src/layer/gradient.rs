//! Convolution that records gradients, on the same kernels.
//!
//! The gradient of the input is the convolution of the output's
//! gradient, spread by the stride, with the kernel turned by 180 degrees and its channels
//! exchanged. That of the weights is a product of the output's gradient and the lowered input.

use std::borrow::Cow;

use burn::{
    backend::{
        Autodiff, Backend, Flex,
        autodiff::{
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        flex::FlexTensor,
        tensor::FloatTensor,
    },
    tensor::{Bytes, DType, Shape, TensorData},
};
use rayon::prelude::*;

use super::kernel::{Activation, Finish, Geometry, Weights, weights_gradient};

/// Sizes of a convolution whose groups are 1, as the backends hand them on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub(super) forward: Geometry,
    pub(super) output: [usize; 2],
}

/// Convolutions of one group, for burn's dispatch.
#[backend_extension(Flex, Autodiff)]
pub(super) trait Convolve: Backend {
    /// `[images, n_out, height, width]` of `[images, channels, …]` and `[n_out, channels, kernel]`.
    fn convolve(
        input: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self>;

    /// Gradient of the input, from that of the output.
    fn convolve_input_gradient(
        weights: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self>;

    /// Gradient of the weights, from that of the output.
    fn convolve_weights_gradient(
        input: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self>;
}

const PLAIN: Finish<'static> =
    Finish { scale: None, shift: None, residual: None, activation: Activation::None };

/// The values of a contiguous tensor.
pub(super) fn values(tensor: &FlexTensor) -> &[f32] {
    let layout = tensor.layout();
    &tensor.storage::<f32>()[layout.start_offset()..][..layout.num_elements()]
}

/// A tensor of these values.
pub(super) fn tensor(values: Vec<f32>, shape: impl Into<Shape>) -> FlexTensor {
    let bytes = Bytes::from_elems(values);
    FlexTensor::from_data(TensorData::from_bytes(bytes, shape.into(), DType::F32))
}

/// `[a, b, …]` to `[b, a, …]`, each plane turned by 180 degrees.
fn exchanged_and_turned(values: &[f32], [a, b]: [usize; 2]) -> Vec<f32> {
    let plane = values.len() / (a * b);
    let mut exchanged = vec![0.0; values.len()];
    exchanged.par_chunks_exact_mut(a * plane).enumerate().for_each(|(inner, planes)| {
        for (outer, turned) in planes.chunks_exact_mut(plane).enumerate() {
            let plane = &values[(outer * b + inner) * plane..][..plane];
            turned.iter_mut().zip(plane.iter().rev()).for_each(|(to, &from)| *to = from);
        }
    });
    exchanged
}

/// Planes with `stride - 1` zeros between neighbours, and `more` zeros behind.
fn spread(
    values: &[f32],
    [height, width]: [usize; 2],
    stride: [usize; 2],
    more: [usize; 2],
) -> (Cow<'_, [f32]>, [usize; 2]) {
    if stride == [1, 1] && more == [0, 0] {
        return (values.into(), [height, width]);
    }
    let size = [(height - 1) * stride[0] + 1 + more[0], (width - 1) * stride[1] + 1 + more[1]];
    let n_planes = values.len() / (height * width);
    let mut spread = vec![0.0; n_planes * size[0] * size[1]];
    let planes = spread.par_chunks_exact_mut(size[0] * size[1]);
    planes.zip(values.par_chunks_exact(height * width)).for_each(|(to, from)| {
        for (row, from) in from.chunks_exact(width).enumerate() {
            let to = &mut to[row * stride[0] * size[1]..][..size[1]];
            to.iter_mut().step_by(stride[1]).zip(from).for_each(|(to, &from)| *to = from);
        }
    });
    (spread.into(), size)
}

impl Convolve for Flex {
    fn convolve(input: FlexTensor, weights: FlexTensor, sizes: Sizes) -> FlexTensor {
        let (input, weights) = (input.to_contiguous(), weights.to_contiguous());
        let Sizes { forward, output } = sizes;
        let packed = Weights::default();
        let sums = packed.convolve(values(&input), values(&weights), &forward, output, PLAIN);
        tensor(sums, [forward.input[0], forward.n_out, output[0], output[1]])
    }

    fn convolve_input_gradient(
        weights: FlexTensor,
        gradient: FlexTensor,
        sizes: Sizes,
    ) -> FlexTensor {
        let (weights, gradient) = (weights.to_contiguous(), gradient.to_contiguous());
        let Sizes { forward, output } = sizes;
        let [n_images, n_channels, height, width] = forward.input;
        let side = [height, width];
        let reach: [usize; 2] =
            std::array::from_fn(|axis| forward.dilation[axis] * (forward.kernel[axis] - 1));
        // Input behind the last kernel position gets no gradient from there, but must be there.
        let more = std::array::from_fn(|axis| {
            let used = (output[axis] - 1) * forward.stride[axis] + reach[axis] + 1;
            side[axis] + forward.before[axis] + forward.after[axis] - used
        });
        let (gradient, extent) = spread(values(&gradient), output, forward.stride, more);
        // A negative padding is a crop, which the whole gradient with full padding allows.
        let whole = Geometry {
            input: [n_images, forward.n_out, extent[0], extent[1]],
            n_out: n_channels,
            kernel: forward.kernel,
            stride: [1, 1],
            before: std::array::from_fn(|axis| reach[axis].saturating_sub(forward.before[axis])),
            after: std::array::from_fn(|axis| reach[axis].saturating_sub(forward.after[axis])),
            dilation: forward.dilation,
        };
        let turned = exchanged_and_turned(values(&weights), [forward.n_out, n_channels]);
        let whole_size = whole.output().expect("the forward kernel fits, so the turned one does");
        let sums = Weights::default().convolve(&gradient, &turned, &whole, whole_size, PLAIN);
        let crop: [usize; 2] =
            std::array::from_fn(|axis| forward.before[axis].saturating_sub(reach[axis]));
        tensor(cropped(sums, whole_size, crop, side), [n_images, n_channels, height, width])
    }

    fn convolve_weights_gradient(
        input: FlexTensor,
        gradient: FlexTensor,
        sizes: Sizes,
    ) -> FlexTensor {
        let (input, gradient) = (input.to_contiguous(), gradient.to_contiguous());
        let Sizes { forward, output } = sizes;
        let sums = weights_gradient(values(&input), values(&gradient), &forward, output);
        let [kh, kw] = forward.kernel;
        tensor(sums, [forward.n_out, forward.input[1], kh, kw])
    }
}

/// The part of each plane that starts at `from` and has `size`.
fn cropped(values: Vec<f32>, whole: [usize; 2], from: [usize; 2], size: [usize; 2]) -> Vec<f32> {
    if whole == size {
        return values;
    }
    let planes = values.chunks_exact(whole[0] * whole[1]);
    let rows = planes.flat_map(|plane| plane.chunks_exact(whole[1]).skip(from[0]).take(size[0]));
    rows.flat_map(|row| row[from[1]..from[1] + size[1]].iter().copied()).collect()
}

/// The step back through one convolution.
#[derive(Debug)]
struct Back;

impl<B: Convolve> Backward<B, 2> for Back {
    type State = (burn::backend::autodiff::NodeId, burn::backend::autodiff::NodeId, Sizes);

    fn backward(
        self,
        ops: Ops<Self::State, 2>,
        grads: &mut Gradients,
        checkpointer: &mut Checkpointer,
    ) {
        let [input_node, weights_node] = ops.parents;
        let gradient = grads.consume::<B>(&ops.node);
        let (input, weights, sizes) = ops.state;
        let input = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(input);
        let weights = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(weights);
        if let Some(node) = input_node {
            let gradient = B::convolve_input_gradient(weights, gradient.clone(), sizes);
            grads.register::<B>(node.id, gradient);
        }
        if let Some(node) = weights_node {
            grads.register::<B>(node.id, B::convolve_weights_gradient(input, gradient, sizes));
        }
    }
}

impl<B: Convolve, C: CheckpointStrategy> Convolve for Autodiff<B, C> {
    fn convolve(
        input: FloatTensor<Self>,
        weights: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self> {
        match Back.prepare::<C>([input.node(), weights.node()]).compute_bound().stateful() {
            OpsKind::Tracked(mut prepared) => {
                let state = (prepared.checkpoint(&input), prepared.checkpoint(&weights), sizes);
                let output = B::convolve(input.into_primitive(), weights.into_primitive(), sizes);
                prepared.finish(state, output)
            }
            OpsKind::UnTracked(prepared) => prepared.finish(B::convolve(
                input.into_primitive(),
                weights.into_primitive(),
                sizes,
            )),
        }
    }

    fn convolve_input_gradient(
        weights: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::convolve_input_gradient(
            weights.into_primitive(),
            gradient.into_primitive(),
            sizes,
        ))
    }

    fn convolve_weights_gradient(
        input: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sizes: Sizes,
    ) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::convolve_weights_gradient(
            input.into_primitive(),
            gradient.into_primitive(),
            sizes,
        ))
    }
}

/// Gradients of gradients are not needed by any loss here.
pub(super) fn unrecorded<B: Backend, C: CheckpointStrategy>(
    tensor: FloatTensor<B>,
) -> FloatTensor<Autodiff<B, C>> {
    <Autodiff<B, C> as burn::backend::AutodiffBackend>::from_inner(tensor)
}
