//! Spatial pyramid pooling as AMOSNet and HybridNet use it.

use burn::tensor::Tensor;
use vpr_core::Definition;

/// Rows and columns of the map that the published cuts belong to (conv5 of a 227×227 image).
const PUBLISHED_SIDE: usize = 13;

/// The published cuts of levels 2 to 4, from an index to before the next.
const PUBLISHED: [&[(usize, usize)]; 4] = [
    &[(0, 13)],
    &[(0, 6), (7, 12)],
    &[(0, 4), (5, 8), (9, 12)],
    &[(0, 3), (4, 6), (7, 9), (10, 12)],
];

/// Largest value in each cell of pyramids of 1, 4, 9 and 16 cells: `batch × channels × rows × columns`
/// to `batch × channels · 30`, channel by channel, levels and cells in reading order.
///
/// Chen et al., *Deep Learning Features at Scale for Visual Place Recognition* (2017).
/// `Published` are the cuts of VPR-Bench's `AMOSNet.py`, which leave rows and columns 3, 4, 6, 8, 9
/// and 12 out of some levels; `Corrected` cells are contiguous, cell i of s going from ⌊i·side/s⌋
/// to before ⌊(i+1)·side/s⌋.
///
/// # Panics
///
/// If the map is not 13×13 with `Published`, or smaller than 4×4.
#[must_use]
pub fn pyramid(map: Tensor<4>, definition: Definition) -> Tensor<2> {
    let [batch, channels, rows, columns] = map.dims();
    let cells = |level: usize, side: usize| match definition {
        Definition::Published => {
            assert!(
                side == PUBLISHED_SIDE,
                "the published cuts are for 13×13, not {rows}×{columns}"
            );
            PUBLISHED[level].to_vec()
        }
        Definition::Corrected => contiguous(level + 1, side),
    };
    let mut pooled = Vec::new();
    for level in 0..PUBLISHED.len() {
        for (top, bottom) in cells(level, rows) {
            let strip = map.clone().narrow(2, top, bottom - top);
            for (left, right) in cells(level, columns) {
                let cell = strip.clone().narrow(3, left, right - left);
                pooled.push(
                    cell.reshape([batch, channels, (bottom - top) * (right - left)]).max_dim(2),
                );
            }
        }
    }
    Tensor::cat(pooled, 2).flatten(1, 2)
}

fn contiguous(cells: usize, side: usize) -> Vec<(usize, usize)> {
    assert!(side >= cells, "a side of {side} does not hold {cells} cells");
    (0..cells).map(|cell| (cell * side / cells, (cell + 1) * side / cells)).collect()
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    fn counted() -> Tensor<4> {
        let values = (0..169u16).map(f32::from).collect::<Vec<_>>();
        Tensor::from_data(TensorData::new(values, [1, 1, 13, 13]), &Device::flex())
    }

    fn pooled(definition: Definition) -> Vec<f32> {
        pyramid(counted(), definition).into_data().try_to_vec().unwrap()
    }

    #[test]
    fn published_cells_end_where_the_released_slices_end() {
        let cells = pooled(Definition::Published);
        assert_eq!(cells.len(), 30);
        // features[7:12, 0:6] and features[10:12, 10:12]
        assert_eq!((cells[3], cells[29]), ((11 * 13 + 5) as f32, (11 * 13 + 11) as f32));
    }

    #[test]
    fn corrected_cells_reach_the_last_row_and_column() {
        let cells = pooled(Definition::Corrected);
        for last in [0, 4, 13, 29] {
            assert_eq!(cells[last], 168.0);
        }
        assert_eq!(contiguous(4, 13), [(0, 3), (3, 6), (6, 9), (9, 13)]);
    }
}
