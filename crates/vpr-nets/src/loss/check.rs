//! Checks that every loss goes through.

use burn::{
    module::{Module, Param},
    optim::GradientsParams,
    tensor::{Device, Tensor, TensorData},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::train::{Optimizer, seeded};

/// Random rows of length one.
pub(crate) fn unit_rows(n: usize, width: usize, seed: u64) -> (Vec<f32>, [usize; 2]) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut rows = Vec::with_capacity(n * width);
    for _ in 0..n {
        let row: Vec<f32> = (0..width).map(|_| random.random_range(-1.0..1.0)).collect();
        let length = row.iter().map(|x| x * x).sum::<f32>().sqrt();
        rows.extend(row.iter().map(|x| x / length));
    }
    (rows, [n, width])
}

/// Compares the gradient of a loss with central differences, every entry within 1 % of the
/// largest.
pub(crate) fn gradient(
    (values, shape): (Vec<f32>, [usize; 2]),
    loss: impl Fn(Tensor<2>) -> Tensor<1>,
) {
    let device = Device::flex();
    let at = |values: &[f32]| -> f64 {
        let rows = Tensor::from_data(TensorData::new(values.to_vec(), shape), &device);
        f64::from(loss(rows).into_scalar::<f32>())
    };
    let tracked =
        Tensor::<2>::from_data(TensorData::new(values.clone(), shape), &Device::flex().autodiff())
            .require_grad();
    let gradients = loss(tracked.clone()).backward();
    let found: Vec<f32> =
        tracked.grad(&gradients).expect("the loss depends on it").into_data().try_to_vec().unwrap();
    let scale = found.iter().fold(0.0_f32, |most, g| most.max(g.abs()));
    assert!(scale > 1e-4, "the loss is flat here");
    for index in 0..values.len() {
        let step = 2e-3_f32;
        let (mut up, mut down) = (values.clone(), values.clone());
        up[index] += step;
        down[index] -= step;
        let expected = (at(&up) - at(&down)) / f64::from(up[index] - down[index]);
        let gap = (f64::from(found[index]) - expected).abs();
        assert!(
            gap <= 0.01 * f64::from(scale),
            "entry {index}: {} against {expected}",
            found[index]
        );
    }
}

/// [`gradient`] of what `forward` makes of rows, along one direction of its output. `head` lies on a
/// device that records gradients; its weights are drawn anew.
pub(crate) fn head_gradient<M: Module>(
    head: M,
    rows: (Vec<f32>, [usize; 2]),
    forward: impl Fn(&M, Tensor<2>) -> Tensor<2>,
) {
    let recording = seeded(head, 3);
    let plain = recording.clone().valid();
    gradient(rows, |rows| {
        let head = if rows.is_require_grad() { &recording } else { &plain };
        let device = rows.device();
        let descriptors = forward(head, rows);
        let (direction, shape) = unit_rows(1, descriptors.dims()[1], 2);
        let direction = Tensor::from_data(TensorData::new(direction, shape), &device);
        (descriptors * direction).sum()
    });
}

/// The rows of a batch as queries, positives and negatives.
pub(crate) fn thirds(rows: Tensor<2>) -> (Tensor<2>, Tensor<2>, Tensor<2>) {
    let n = rows.dims()[0] / 3;
    (rows.clone().narrow(0, 0, n), rows.clone().narrow(0, n, n), rows.narrow(0, 2 * n, n))
}

/// Lets free rows follow a loss for 300 steps of Adam: it must fall to a twentieth.
pub(crate) fn overfit(
    (values, shape): (Vec<f32>, [usize; 2]),
    loss: impl Fn(Tensor<2>) -> Tensor<1>,
) {
    #[derive(Module, Debug)]
    struct Rows {
        rows: Param<Tensor<2>>,
    }
    let device = Device::flex().autodiff();
    let rows = Tensor::from_data(TensorData::new(values, shape), &device);
    let mut rows = Rows { rows: Param::from_tensor(rows) };
    let mut optimizer = Optimizer::Adam.init();
    let first: f32 = loss(rows.rows.val()).into_scalar();
    for step in 0..300 {
        let gradients = loss(rows.rows.val()).backward();
        let gradients = GradientsParams::from_grads(gradients, &rows);
        rows = optimizer.step(1e-4 * f64::from(300 - step), rows, gradients);
    }
    let last: f32 = loss(rows.rows.val()).into_scalar();
    assert!(first > 0.0 && last < 0.05 * first, "{first} to {last}");
}
