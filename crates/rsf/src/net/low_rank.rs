//! Updates of low rank (Hu et al., "`LoRA`", ICLR 2022): a matrix `W` becomes `W + A B`.

use burn::{
    module::{LoraAdapter, Param, Reparameterizer},
    tensor::{Tensor, TensorData},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Gives matrices an update; a kernel of a convolution is one with a row for each of its outputs.
///
/// `A` is drawn, uniform with rows of length one in the mean, and `B` begins as zero, so that the
/// network begins as it was.
pub(super) struct LowRank {
    matrices: Vec<String>,
    rank: usize,
    random: ChaCha8Rng,
}

impl LowRank {
    /// Updates for the matrices among these parameters.
    pub(super) fn new(parameters: Vec<String>, rank: usize, seed: u64) -> Self {
        Self { matrices: parameters, rank, random: ChaCha8Rng::seed_from_u64(seed) }
    }
}

impl Reparameterizer for LowRank {
    type Reparam = LoraAdapter;

    fn reparameterize<const D: usize>(
        &mut self,
        path: &str,
        param: Param<Tensor<D>>,
    ) -> (Param<Tensor<D>>, Option<LoraAdapter>) {
        if D < 2 || !self.matrices.iter().any(|it| it == path) {
            return (param, None);
        }
        let base = param.base();
        let (dims, device) = (base.dims(), base.device());
        let (rows, columns) = (dims[0], dims[1..].iter().product::<usize>());
        let rank = self.rank.min(rows).min(columns);
        let reach = (3.0 / rank as f32).sqrt();
        let drawn = (0..rows * rank).map(|_| reach * (2.0 * self.random.random::<f32>() - 1.0));
        let a = TensorData::new(drawn.collect::<Vec<f32>>(), [rows, rank]);
        let adapter = LoraAdapter {
            a: Param::from_tensor(Tensor::from_data(a, &device)),
            b: Param::from_tensor(Tensor::zeros([rank, columns], &device)),
            scale: 1.0,
        };
        (param, Some(adapter))
    }
}
