//! Updates of low rank (Hu et al., "`LoRA`", ICLR 2022): a matrix `W` becomes `W + A B`.

use burn::{
    module::{LoraAdapter, Param, Reparameterizer},
    tensor::{Tensor, TensorData},
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Gives matrices an update; a kernel of a convolution is one with a row for each of its outputs.
///
/// The factor on the side of the inputs is drawn, uniform with vectors of length one in the mean, and
/// the other begins as zero, so that the network begins as it was.
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
        // A layer's matrix has its inputs as rows, a convolution as columns.
        let n_inputs = if D == 2 { rows } else { columns };
        let reach = (3.0 / n_inputs as f32).sqrt();
        let random = &mut self.random;
        let drawn = (0..rank * n_inputs).map(|_| reach * (2.0 * random.random::<f32>() - 1.0));
        let drawn: Vec<f32> = drawn.collect();
        let (a, b) = if D == 2 {
            (drawn, vec![0.0; rank * columns])
        } else {
            (vec![0.0; rows * rank], drawn)
        };
        let factor = |values: Vec<f32>, shape: [usize; 2]| {
            Param::from_tensor(Tensor::from_data(TensorData::new(values, shape), &device))
        };
        let (a, b) = (factor(a, [rows, rank]), factor(b, [rank, columns]));
        let adapter = LoraAdapter { a, b, scale: 1.0 };
        (param, Some(adapter))
    }
}
