//! Linear layers that record gradients, alone or before GELU, as one operation on our products.
//!
//! burn takes the product, the bias and half a dozen passes of GELU one after the other, and more on the
//! way back. Sums run in the order of the depth: the same bits for any number of threads.

use burn::{
    backend::{
        Autodiff, Backend, Dispatch, Flex,
        autodiff::{
            NodeId,
            checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
            grads::Gradients,
            ops::{Backward, Ops, OpsKind},
        },
        backend_extension,
        flex::FlexTensor,
        tensor::FloatTensor,
    },
    nn::Linear,
    tensor::{Tensor, activation},
};

use super::{
    conv2d::is_recorded_here,
    gradient::{tensor, unrecorded, values},
    kernel::{product, product_by_columns, product_by_rows},
    one_pass::{self, gelu_gradient},
};

/// Rows through a linear layer with a bias, `n × from` to `n × to`; without one it is burn's.
///
/// # Panics
///
/// If the rows have another length than the layer takes.
#[must_use]
pub fn dense(layer: &Linear, rows: Tensor<2>) -> Tensor<2> {
    through(layer, &rows, false).unwrap_or_else(|| layer.forward(rows))
}

/// The same, then GELU, x Φ(x), to 1.5e-7 |x|.
///
/// # Panics
///
/// If the rows have another length than the layer takes.
#[must_use]
pub fn dense_gelu(layer: &Linear, rows: Tensor<2>) -> Tensor<2> {
    through(layer, &rows, true).unwrap_or_else(|| activation::gelu(layer.forward(rows)))
}

/// `None` where burn's operations must do it.
fn through(layer: &Linear, rows: &Tensor<2>, is_gelu: bool) -> Option<Tensor<2>> {
    let [n, length] = rows.dims();
    let [from, to] = layer.weight.dims();
    assert_eq!(length, from, "values of a row");
    let bias = layer.bias.as_ref()?.val().into_dispatch();
    let (rows, weight) = (rows.clone().into_dispatch(), layer.weight.val().into_dispatch());
    let is_here = is_recorded_here(&rows.kind) && is_recorded_here(&weight.kind);
    if !is_here || n * from * to == 0 {
        return None;
    }
    let [output, _] = Dispatch::pass(rows, weight, bias, is_gelu).into();
    Some(Tensor::from_dispatch(output))
}

/// A linear layer, for burn's dispatch.
#[backend_extension(Flex, Autodiff)]
pub(super) trait Pass: Backend {
    /// The output `n × to` of rows `n × from`, weight `from × to` and bias, and what GELU was taken of
    /// where it is (elsewhere nothing, 1 × 1).
    fn pass(
        rows: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        is_gelu: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>);

    /// Gradient before GELU, from that of the output.
    fn pass_before(before: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradient of the rows.
    fn pass_rows(weight: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradient of the weight.
    fn pass_weight(rows: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self>;

    /// Gradient of the bias.
    fn pass_bias(gradient: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Rows and columns.
fn sides(tensor: &FlexTensor) -> [usize; 2] {
    let shape = tensor.layout().shape();
    [shape[0], shape[1]]
}

impl Pass for Flex {
    fn pass(
        rows: FlexTensor,
        weight: FlexTensor,
        bias: FlexTensor,
        is_gelu: bool,
    ) -> (FlexTensor, FlexTensor) {
        let [rows, weight, bias] = [rows, weight, bias].map(|it| it.to_contiguous());
        let ([n, from], [_, to]) = (sides(&rows), sides(&weight));
        let mut sums = product(values(&rows), values(&weight), from);
        one_pass::add_row(&mut sums, values(&bias));
        if !is_gelu {
            return (tensor(sums, [n, to]), tensor(vec![0.0], [1, 1]));
        }
        (tensor(one_pass::gelu(&sums, &vec![0.0; to]), [n, to]), tensor(sums, [n, to]))
    }

    fn pass_before(before: FlexTensor, gradient: FlexTensor) -> FlexTensor {
        let [before, gradient] = [before, gradient].map(|it| it.to_contiguous());
        let shape @ [_, width] = sides(&before);
        tensor(gelu_gradient(values(&before), values(&gradient), width), shape)
    }

    fn pass_rows(weight: FlexTensor, gradient: FlexTensor) -> FlexTensor {
        let [weight, gradient] = [weight, gradient].map(|it| it.to_contiguous());
        let ([from, to], [n, _]) = (sides(&weight), sides(&gradient));
        tensor(product_by_rows(values(&gradient), values(&weight), to), [n, from])
    }

    fn pass_weight(rows: FlexTensor, gradient: FlexTensor) -> FlexTensor {
        let [rows, gradient] = [rows, gradient].map(|it| it.to_contiguous());
        let ([n, from], [_, to]) = (sides(&rows), sides(&gradient));
        tensor(product_by_columns(values(&rows), values(&gradient), n), [from, to])
    }

    fn pass_bias(gradient: FlexTensor) -> FlexTensor {
        let gradient = gradient.to_contiguous();
        let [_, to] = sides(&gradient);
        let mut sums = vec![0.0; to];
        for row in values(&gradient).chunks_exact(to) {
            sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
        }
        tensor(sums, [to])
    }
}

/// The step back through one layer.
#[derive(Debug)]
struct Back;

impl<B: Pass> Backward<B, 3> for Back {
    /// Rows and weight, which are kept or made again; what GELU was taken of, if it was.
    type State = (NodeId, NodeId, Option<FloatTensor<B>>);

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        grads: &mut Gradients,
        checkpointer: &mut Checkpointer,
    ) {
        let [of_rows, of_weight, of_bias] = ops.parents;
        let gradient = grads.consume::<B>(&ops.node);
        let (rows, weight, before) = ops.state;
        let rows = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(rows);
        let weight = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(weight);
        let gradient = match before {
            Some(before) => B::pass_before(before, gradient),
            None => gradient,
        };
        if let Some(node) = of_rows {
            grads.register::<B>(node.id, B::pass_rows(weight, gradient.clone()));
        }
        if let Some(node) = of_weight {
            grads.register::<B>(node.id, B::pass_weight(rows, gradient.clone()));
        }
        if let Some(node) = of_bias {
            grads.register::<B>(node.id, B::pass_bias(gradient));
        }
    }
}

impl<B: Pass, C: CheckpointStrategy> Pass for Autodiff<B, C> {
    fn pass(
        rows: FloatTensor<Self>,
        weight: FloatTensor<Self>,
        bias: FloatTensor<Self>,
        is_gelu: bool,
    ) -> (FloatTensor<Self>, FloatTensor<Self>) {
        let nodes = [rows.node(), weight.node(), bias.node()];
        let (output, before) = match Back.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(mut prepared) => {
                let (of_rows, of_weight) =
                    (prepared.checkpoint(&rows), prepared.checkpoint(&weight));
                let (rows, weight, bias) =
                    (rows.into_primitive(), weight.into_primitive(), bias.into_primitive());
                let (output, before) = B::pass(rows, weight, bias, is_gelu);
                let state = (of_rows, of_weight, is_gelu.then(|| before.clone()));
                (prepared.finish(state, output), before)
            }
            OpsKind::UnTracked(prepared) => {
                let (rows, weight, bias) =
                    (rows.into_primitive(), weight.into_primitive(), bias.into_primitive());
                let (output, before) = B::pass(rows, weight, bias, is_gelu);
                (prepared.finish(output), before)
            }
        };
        (output, unrecorded::<B, C>(before))
    }

    fn pass_before(before: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::pass_before(before.into_primitive(), gradient.into_primitive()))
    }

    fn pass_rows(weight: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::pass_rows(weight.into_primitive(), gradient.into_primitive()))
    }

    fn pass_weight(rows: FloatTensor<Self>, gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::pass_weight(rows.into_primitive(), gradient.into_primitive()))
    }

    fn pass_bias(gradient: FloatTensor<Self>) -> FloatTensor<Self> {
        unrecorded::<B, C>(B::pass_bias(gradient.into_primitive()))
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        module::{Module, Param},
        nn::LinearConfig,
        tensor::{Device, Distribution},
    };

    use super::*;

    const NORMAL: Distribution = Distribution::Normal(0.1, 1.5);

    fn relative<const D: usize>(ours: Tensor<D>, burns: Tensor<D>) -> f32 {
        let error = (ours - burns.clone()).square().sum() / burns.square().sum();
        error.sqrt().into_scalar()
    }

    /// Output, then gradients of rows, weight and bias.
    type Run = (Tensor<2>, Tensor<2>, Tensor<2>, Tensor<1>);

    fn run(
        layer: &Linear,
        rows: &Tensor<2>,
        weighting: &Tensor<2>,
        forward: impl Fn(Tensor<2>) -> Tensor<2>,
    ) -> Run {
        let output = forward(rows.clone());
        let gradients = (output.clone() * weighting.clone()).sum().backward();
        let of_weight = layer.weight.val().grad(&gradients).unwrap();
        let of_bias = layer.bias.as_ref().unwrap().val().grad(&gradients).unwrap();
        (output.inner(), rows.grad(&gradients).unwrap(), of_weight, of_bias)
    }

    #[test]
    fn a_layer_and_its_gradients_are_burns() {
        let device = Device::flex().autodiff();
        for (n, from, to) in [(1, 1, 1), (33, 37, 70), (7, 519, 300), (300, 20, 17)] {
            let mut layer = LinearConfig::new(from, to).init(&device);
            layer.bias = Some(Param::from_tensor(Tensor::random([to], NORMAL, &device)));
            let rows = Tensor::random([n, from], NORMAL, &device).require_grad();
            let weighting = Tensor::random([n, to], NORMAL, &device);
            for (ours, burns) in [
                (
                    run(&layer, &rows, &weighting, |it| dense(&layer, it)),
                    run(&layer, &rows, &weighting, |it| layer.forward(it)),
                ),
                (
                    run(&layer, &rows, &weighting, |it| dense_gelu(&layer, it)),
                    run(&layer, &rows, &weighting, |it| activation::gelu(layer.forward(it))),
                ),
            ] {
                for error in [
                    relative(ours.0, burns.0),
                    relative(ours.1, burns.1),
                    relative(ours.2, burns.2),
                    relative(ours.3, burns.3),
                ] {
                    assert!(error < 2e-6, "{n} × {from} to {to}: {error}");
                }
            }
        }
    }

    #[test]
    fn without_gradients_is_as_with() {
        let (device, recording) = (Device::flex(), Device::flex().autodiff());
        let layer = LinearConfig::new(30, 40).init(&recording);
        let rows = Tensor::<2>::random([5, 30], NORMAL, &device);
        let recorded = Tensor::from_data(rows.to_data(), &recording).require_grad();
        let same = dense_gelu(&layer, recorded).inner();
        dense_gelu(&layer.valid(), rows).into_data().assert_eq(&same.into_data(), true);
    }

    #[test]
    fn a_layer_without_bias_is_burns() {
        let device = Device::flex();
        let layer = LinearConfig::new(3, 2).with_bias(false).init(&device);
        let rows = Tensor::<2>::random([4, 3], NORMAL, &device);
        let burns = layer.forward(rows.clone());
        dense(&layer, rows).into_data().assert_eq(&burns.into_data(), true);
    }
}
