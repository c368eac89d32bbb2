//! Where the learned queries of a BoQ head look.

use burn::tensor::{Tensor, TensorData};
use vpr_nets::{
    encode::registry::Method,
    model::{default::INPUT, headed::BoqDefault},
};
use vpr_vision::image::RgbImage;

use crate::Result;

/// Attention of every learned query of the last block over the positions of the map, and the map's
/// rows and columns.
pub(crate) fn looks(network: &BoqDefault, image: &RgbImage) -> Result<(Vec<Vec<f32>>, [usize; 2])> {
    let (input, _) = Method::find("default", None)?.preprocessing().apply(image)?;
    let input = TensorData::new(input, [1, 3, INPUT.1, INPUT.0]);
    let map = network.located_map(Tensor::from_data(input, &vpr_nets::device()));
    let [_, _, rows, columns] = map.dims();
    let (_, blocks) = network.head().forward_with_attention(map);
    let last = blocks.into_iter().next_back();
    let values: Vec<f32> = last.map_or_else(Vec::new, |it| it.into_data().iter().collect());
    Ok((values.chunks(rows * columns).map(<[f32]>::to_vec).collect(), [rows, columns]))
}
