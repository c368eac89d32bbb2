//! From bytes to f32.

use std::{collections::BTreeMap, path::Path};

use half::{bf16, f16};
use vpr_files::pickle::{Element, Tensor as View};

use super::Tensor;
use crate::{Error, Result};

/// How many times as many values as the file has bytes its tensors may hold.
const MAX_EXPANSION: usize = 4;

/// The tensors of a checkpoint; `bytes_of` finds the bytes of a storage by its name.
pub(super) fn tensors<'a>(
    path: &Path,
    views: BTreeMap<String, View>,
    file_len: usize,
    mut bytes_of: impl FnMut(&View) -> Result<std::borrow::Cow<'a, [u8]>>,
) -> Result<BTreeMap<String, Tensor>> {
    let mut budget = file_len.saturating_mul(MAX_EXPANSION);
    let mut tensors: BTreeMap<String, Tensor> = BTreeMap::new();
    for (key, view) in views {
        let n_values: usize = view.shape.iter().product();
        budget = budget.checked_sub(n_values).ok_or_else(|| {
            let reason =
                format!("shared tensors expand to more than {MAX_EXPANSION} times the file");
            Error::format(path, key.clone(), reason)
        })?;
        let bytes = bytes_of(&view)?;
        let needed = view.storage_len.checked_mul(view.element.size());
        if needed.is_none_or(|needed| bytes.len() < needed) {
            let reason = format!(
                "its storage of {} elements has only {} bytes",
                view.storage_len,
                bytes.len()
            );
            return Err(Error::format(path, key, reason));
        }
        let data = gather(&view, &bytes, n_values);
        check_finite(path, &key, &data)?;
        tensors.insert(key, Tensor { shape: view.shape, data });
    }
    Ok(tensors)
}

/// The elements of a view in row-major order; it lies inside its storage, as decoding checked.
fn gather(view: &View, bytes: &[u8], n_values: usize) -> Vec<f32> {
    let size = view.element.size();
    if is_contiguous(view) {
        let start = view.offset * size;
        return numbers(view.element, &bytes[start..start + n_values * size]);
    }
    let mut index = vec![0; view.shape.len()];
    let mut data = Vec::with_capacity(n_values);
    for _ in 0..n_values {
        let at = index.iter().zip(&view.strides).map(|(i, stride)| i * stride).sum::<usize>();
        let start = (view.offset + at) * size;
        data.extend(numbers(view.element, &bytes[start..start + size]));
        for (i, &len) in index.iter_mut().zip(&view.shape).rev() {
            *i += 1;
            if *i < len {
                break;
            }
            *i = 0;
        }
    }
    data
}

fn is_contiguous(view: &View) -> bool {
    let mut expected = 1;
    view.shape.iter().zip(&view.strides).rev().all(|(&len, &stride)| {
        let fits = len <= 1 || stride == expected;
        expected *= len.max(1);
        fits
    })
}

/// Little-endian elements as f32; integers beyond 2^24 are rounded.
#[expect(clippy::cast_possible_truncation, reason = "weights are f32")]
pub(super) fn numbers(element: Element, bytes: &[u8]) -> Vec<f32> {
    fn each<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
        bytes.as_chunks::<N>().0.iter().map(|&chunk| number(chunk)).collect()
    }
    match element {
        Element::F64 => each(bytes, |b| f64::from_le_bytes(b) as f32),
        Element::F32 => each(bytes, f32::from_le_bytes),
        Element::F16 => each(bytes, |b| f16::from_le_bytes(b).to_f32()),
        Element::BF16 => each(bytes, |b| bf16::from_le_bytes(b).to_f32()),
        Element::I64 => each(bytes, |b| i64::from_le_bytes(b) as f32),
        Element::I32 => each(bytes, |b| i32::from_le_bytes(b) as f32),
        Element::I16 => each(bytes, |b| i16::from_le_bytes(b).into()),
        Element::I8 => each(bytes, |b| i8::from_le_bytes(b).into()),
        Element::U8 => each(bytes, |b| u8::from_le_bytes(b).into()),
        Element::Bool => each(bytes, |[b]: [u8; 1]| f32::from(u8::from(b != 0))),
    }
}

/// Refuses a NaN or infinity.
pub(super) fn check_finite(path: &Path, key: &str, data: &[f32]) -> Result<()> {
    match data.iter().position(|value| !value.is_finite()) {
        None => Ok(()),
        Some(index) => {
            let reason = format!("value {index} is {}, not a finite number", data[index]);
            Err(Error::format(path, key, reason))
        }
    }
}

/// Removes `module.`, which PyTorch's data-parallel wrapper puts before every key.
pub(super) fn without_shared_prefix(tensors: BTreeMap<String, Tensor>) -> BTreeMap<String, Tensor> {
    const PREFIX: &str = "module.";
    if !tensors.keys().all(|key| key.len() > PREFIX.len() && key.starts_with(PREFIX)) {
        return tensors;
    }
    tensors.into_iter().map(|(key, tensor)| (key[PREFIX.len()..].to_owned(), tensor)).collect()
}
