//! Tensors as slices, where they lie in this process's memory and nothing records gradients.

use std::sync::Arc;

use burn::{
    backend::{BackendTensor, DispatchTensorKind, flex::FlexTensor},
    tensor::{Bytes, DType, Device, Tensor, TensorData},
};

/// A contiguous f32 tensor on the CPU.
#[derive(Clone, Debug)]
pub(crate) struct InMemory(FlexTensor);

impl InMemory {
    /// The tensor's values in order; `None` if it is recorded for gradients, lies on another
    /// device or holds other numbers.
    pub(crate) fn new<const D: usize>(tensor: &Tensor<D>) -> Option<Self> {
        match tensor.clone().into_dispatch().kind {
            DispatchTensorKind::Flex(BackendTensor::Float(tensor))
                if tensor.dtype() == DType::F32 =>
            {
                Some(Self(tensor.to_contiguous()))
            }
            _ => None,
        }
    }

    /// The values in row-major order.
    pub(crate) fn values(&self) -> &[f32] {
        let layout = self.0.layout();
        &self.0.storage::<f32>()[layout.start_offset()..][..layout.num_elements()]
    }

    /// Whether both are the same memory, so that what was made from one holds for the other as
    /// long as both live.
    pub(crate) fn is_same(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0.data_arc(), &other.0.data_arc())
            && self.0.layout().start_offset() == other.0.layout().start_offset()
    }
}

/// A contiguous f32 tensor on the CPU whose values are written in place.
#[derive(Debug)]
pub(crate) struct InMemoryMut {
    tensor: FlexTensor,
    device: Device,
}

impl InMemoryMut {
    /// Takes the tensor; its values are copied if others hold them too.
    ///
    /// # Panics
    ///
    /// Where [`InMemory::new`] gives `None`.
    pub(crate) fn new<const D: usize>(tensor: Tensor<D>) -> Self {
        let device = tensor.device();
        let InMemory(flat) = InMemory::new(&tensor).expect("an f32 tensor in memory");
        drop(tensor);
        // A view of a part of the memory gets memory of its own.
        let is_whole = flat.layout().start_offset() == 0;
        let tensor = if is_whole { flat } else { FlexTensor::from_data(flat.into_data()) };
        Self { tensor, device }
    }

    /// The values in row-major order.
    pub(crate) fn values(&mut self) -> &mut [f32] {
        let n = self.tensor.layout().num_elements();
        &mut self.tensor.storage_mut::<f32>()[..n]
    }

    /// The tensor with its new values.
    pub(crate) fn tensor<const D: usize>(self) -> Tensor<D> {
        Tensor::from_data(self.tensor.into_data(), &self.device)
    }
}

/// A tensor of these values.
pub(crate) fn tensor<const D: usize>(
    values: Vec<f32>,
    shape: [usize; D],
    device: &Device,
) -> Tensor<D> {
    let bytes = Bytes::from_elems(values);
    Tensor::from_data(TensorData::from_bytes(bytes, shape, DType::F32), device)
}
