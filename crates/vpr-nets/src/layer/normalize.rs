//! Batch and group normalisation that record gradients, as one operation each.

use burn::{
    backend::{
        Autodiff, Backend, Dispatch, DispatchTensor, Flex,
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
    nn::{BatchNorm, GroupNorm},
    tensor::Tensor,
};

use super::{
    conv2d::is_recorded_here,
    gradient::{tensor, unrecorded, values},
};
use crate::layer::one_pass::{Moments, Sets, Sharing};

/// Normalisation of `[images, channels, height, width]` by the statistics of the batch where `norm`
/// is in training, by its running ones elsewhere; burn's layer, whose running variance is over n
/// (PyTorch's is over n − 1).
pub(super) fn batch_norm(norm: &BatchNorm, map: Tensor<4>) -> Tensor<4> {
    let channels = norm.gamma.val().dims()[0];
    let is_training = map.device().is_autodiff() && norm.training.is_enabled();
    if !is_training || map.dims()[1] != channels || !is_recorded(&map) {
        return norm.forward(map);
    }
    let (gamma, beta) = (norm.gamma.val(), norm.beta.val());
    let [normed, mean, variance] = normalize(map, gamma, beta, Sharing::Channel, norm.epsilon);
    let keep = 1.0 - norm.momentum;
    for (running, of_batch) in [(&norm.running_mean, mean), (&norm.running_var, variance)] {
        let of_batch = Tensor::<1>::from_dispatch(of_batch).detach().mul_scalar(norm.momentum);
        running.update((running.value_sync().mul_scalar(keep) + of_batch).detach());
    }
    Tensor::from_dispatch(normed)
}

/// Group normalisation of `[images, channels, height, width]`, as `torch.nn.GroupNorm`; `None`
/// where burn's must do it.
pub(super) fn group_norm(norm: &GroupNorm, map: &Tensor<4>) -> Option<Tensor<4>> {
    let (gamma, beta) = (norm.gamma.as_ref()?.val(), norm.beta.as_ref()?.val());
    if !is_recorded(map) {
        return None;
    }
    let sharing = Sharing::Groups(norm.num_groups);
    let [normed, ..] = normalize(map.clone(), gamma, beta, sharing, norm.epsilon);
    Some(Tensor::from_dispatch(normed))
}

fn is_recorded(map: &Tensor<4>) -> bool {
    map.dims().iter().all(|&it| it > 0) && is_recorded_here(&map.clone().into_dispatch().kind)
}

fn normalize(
    map: Tensor<4>,
    gamma: Tensor<1>,
    beta: Tensor<1>,
    sharing: Sharing,
    epsilon: f64,
) -> [DispatchTensor; 3] {
    let [images, channels, height, width] = map.dims();
    #[expect(clippy::cast_possible_truncation, reason = "a small constant")]
    let epsilon = epsilon as f32;
    let sets = Sets { images, channels, plane: height * width, sharing, epsilon };
    let (map, gamma, beta) = (map.into_dispatch(), gamma.into_dispatch(), beta.into_dispatch());
    Dispatch::normalize(map, gamma, beta, sets).into()
}

/// Normalisation of a map over sets of its planes, for burn's dispatch.
#[backend_extension(Flex, Autodiff)]
pub(super) trait Normalize: Backend {
    /// The normalised map, and mean and variance of every set.
    fn normalize(
        map: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        sets: Sets,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);

    /// Gradients of map, gamma and beta, from that of the normalised map.
    fn normalize_gradients(
        map: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        variance: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sets: Sets,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>);
}

impl Normalize for Flex {
    fn normalize(
        map: FlexTensor,
        gamma: FlexTensor,
        beta: FlexTensor,
        sets: Sets,
    ) -> (FlexTensor, FlexTensor, FlexTensor) {
        let shape = map.layout().shape().clone();
        let [map, gamma, beta] = [map, gamma, beta].map(|it| it.to_contiguous());
        let moments = sets.moments(values(&map));
        let normed = sets.normalize(values(&map), &moments, [values(&gamma), values(&beta)]);
        let of_sets = |values| tensor(values, [sets.len()]);
        (tensor(normed, shape), of_sets(moments.mean), of_sets(moments.variance))
    }

    fn normalize_gradients(
        map: FlexTensor,
        gamma: FlexTensor,
        mean: FlexTensor,
        variance: FlexTensor,
        gradient: FlexTensor,
        sets: Sets,
    ) -> (FlexTensor, FlexTensor, FlexTensor) {
        let shape = map.layout().shape().clone();
        let [map, gamma, mean, variance, gradient] =
            [map, gamma, mean, variance, gradient].map(|it| it.to_contiguous());
        let moments =
            Moments { mean: values(&mean).to_vec(), variance: values(&variance).to_vec() };
        let all = sets.gradients(values(&map), &moments, values(&gamma), values(&gradient));
        let of_channels = |values| tensor(values, [sets.channels]);
        (tensor(all.map, shape), of_channels(all.gamma), of_channels(all.beta))
    }
}

/// The step back through one normalisation.
#[derive(Debug)]
struct Back;

impl<B: Normalize> Backward<B, 3> for Back {
    /// Map and gamma, which are kept or made again; mean, variance and sizes.
    type State = (NodeId, NodeId, FloatTensor<B>, FloatTensor<B>, Sets);

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        grads: &mut Gradients,
        checkpointer: &mut Checkpointer,
    ) {
        let gradient = grads.consume::<B>(&ops.node);
        let (map, gamma, mean, variance, sets) = ops.state;
        let map = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(map);
        let gamma = checkpointer.retrieve_node_output::<B::FloatTensorPrimitive>(gamma);
        let (map, gamma, beta) = B::normalize_gradients(map, gamma, mean, variance, gradient, sets);
        for (node, gradient) in ops.parents.into_iter().zip([map, gamma, beta]) {
            if let Some(node) = node {
                grads.register::<B>(node.id, gradient);
            }
        }
    }
}

impl<B: Normalize, C: CheckpointStrategy> Normalize for Autodiff<B, C> {
    fn normalize(
        map: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
        sets: Sets,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let nodes = [map.node(), gamma.node(), beta.node()];
        let (output, mean, variance) = match Back.prepare::<C>(nodes).compute_bound().stateful() {
            OpsKind::Tracked(mut prepared) => {
                let (of_map, of_gamma) = (prepared.checkpoint(&map), prepared.checkpoint(&gamma));
                let (map, gamma, beta) =
                    (map.into_primitive(), gamma.into_primitive(), beta.into_primitive());
                let (output, mean, variance) = B::normalize(map, gamma, beta, sets);
                let state = (of_map, of_gamma, mean.clone(), variance.clone(), sets);
                (prepared.finish(state, output), mean, variance)
            }
            OpsKind::UnTracked(prepared) => {
                let (map, gamma, beta) =
                    (map.into_primitive(), gamma.into_primitive(), beta.into_primitive());
                let (output, mean, variance) = B::normalize(map, gamma, beta, sets);
                (prepared.finish(output), mean, variance)
            }
        };
        (output, unrecorded::<B, C>(mean), unrecorded::<B, C>(variance))
    }

    fn normalize_gradients(
        map: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        mean: FloatTensor<Self>,
        variance: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        sets: Sets,
    ) -> (FloatTensor<Self>, FloatTensor<Self>, FloatTensor<Self>) {
        let (map, gamma, beta) = B::normalize_gradients(
            map.into_primitive(),
            gamma.into_primitive(),
            mean.into_primitive(),
            variance.into_primitive(),
            gradient.into_primitive(),
            sets,
        );
        (unrecorded::<B, C>(map), unrecorded::<B, C>(gamma), unrecorded::<B, C>(beta))
    }
}

#[cfg(test)]
mod tests {
    use burn::{
        module::Param,
        nn::{BatchNormConfig, GroupNormConfig},
        tensor::{Device, Distribution},
    };

    use super::*;

    const NORMAL: Distribution = Distribution::Normal(0.3, 2.0);

    fn relative<const D: usize>(ours: Tensor<D>, burns: Tensor<D>) -> f32 {
        let error = (ours - burns.clone()).square().sum() / burns.square().sum();
        error.sqrt().into_scalar()
    }

    /// Output, gradients of the map, of gamma and of beta.
    fn run(
        map: &Tensor<4>,
        [gamma, beta]: [&Tensor<1>; 2],
        forward: impl Fn(Tensor<4>) -> Tensor<4>,
        weighting: &Tensor<4>,
    ) -> (Tensor<4>, Tensor<4>, Tensor<1>, Tensor<1>) {
        let output = forward(map.clone());
        let gradients = (output.clone() * weighting.clone()).sum().backward();
        let of = |it: &Tensor<1>| it.grad(&gradients).unwrap();
        (output.inner(), map.grad(&gradients).unwrap(), of(gamma), of(beta))
    }

    fn assert_equal(
        ours: (Tensor<4>, Tensor<4>, Tensor<1>, Tensor<1>),
        burns: (Tensor<4>, Tensor<4>, Tensor<1>, Tensor<1>),
    ) {
        for error in [
            relative(ours.0, burns.0),
            relative(ours.1, burns.1),
            relative(ours.2, burns.2),
            relative(ours.3, burns.3),
        ] {
            assert!(error < 1e-5, "{error}");
        }
    }

    #[test]
    fn batch_normalisation_its_gradients_and_running_moments_are_burns() {
        let device = Device::flex().autodiff();
        let random = |n| Param::from_tensor(Tensor::<1>::random([n], NORMAL, &device));
        let mut norms = [(); 2].map(|()| BatchNormConfig::new(12).init(&device));
        let (gamma, beta) = (random(12), random(12));
        for norm in &mut norms {
            (norm.gamma, norm.beta) = (gamma.clone(), beta.clone());
        }
        let map = Tensor::random([5, 12, 7, 9], NORMAL, &device).require_grad();
        let weighting = Tensor::random([5, 12, 7, 9], NORMAL, &device);
        let parameters = [&gamma.val(), &beta.val()];
        let [first, second] = &norms;
        assert_equal(
            run(&map, parameters, |it| batch_norm(first, it), &weighting),
            run(&map, parameters, |it| second.forward(it), &weighting),
        );
        let moments =
            |norm: &BatchNorm| (norm.running_mean.value_sync(), norm.running_var.value_sync());
        let ((mean, variance), (burns_mean, burns_variance)) = (moments(first), moments(second));
        assert!(relative(mean, burns_mean) < 1e-5);
        assert!(relative(variance, burns_variance) < 1e-5);
    }

    #[test]
    fn group_normalisation_and_its_gradients_are_burns() {
        let device = Device::flex().autodiff();
        let random = |n| Param::from_tensor(Tensor::<1>::random([n], NORMAL, &device));
        let mut norm = GroupNormConfig::new(3, 12).init(&device);
        (norm.gamma, norm.beta) = (Some(random(12)), Some(random(12)));
        let map = Tensor::random([5, 12, 7, 9], NORMAL, &device).require_grad();
        let weighting = Tensor::random([5, 12, 7, 9], NORMAL, &device);
        let (gamma, beta) = (norm.gamma.as_ref().unwrap().val(), norm.beta.as_ref().unwrap().val());
        assert_equal(
            run(&map, [&gamma, &beta], |it| group_norm(&norm, &it).unwrap(), &weighting),
            run(&map, [&gamma, &beta], |it| norm.forward(it), &weighting),
        );
    }
}
