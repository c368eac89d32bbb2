//! Where networks compute: the processor, or a device that burn was built for.
//!
//! On the processor layers use the kernels of this crate; elsewhere they are burn's own operations
//! (features `wgpu` and `cuda`), whose results differ by rounding.

use std::{cell::Cell, fmt, panic, str::FromStr, sync::Once, thread};

use burn::tensor::{Device, Tensor, TensorData};

use crate::{Error, Result};

/// A device by its name: `cpu`, `wgpu`, `cuda`, or the n-th of its kind, `cuda:1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum DeviceChoice {
    /// The processor.
    #[default]
    Cpu,
    /// A graphics adapter through wgpu (Vulkan, Metal, Direct3D), by its place in the list.
    Wgpu(usize),
    /// An Nvidia card, by its place in the list.
    Cuda(usize),
}

impl DeviceChoice {
    /// The device, ready for tensors.
    ///
    /// # Errors
    ///
    /// [`Error::Device`] if the program was built without it, its driver is missing, or there are
    /// not so many of its kind.
    pub fn open(self) -> Result<Device> {
        match self {
            Self::Cpu => Ok(Device::flex()),
            Self::Wgpu(n) => self.nth(n, wgpu(), "wgpu"),
            Self::Cuda(n) => self.nth(n, cuda(), "cuda"),
        }
    }

    /// The n-th of the devices that are there.
    fn nth(self, n: usize, there: Option<Enumerate>, feature: &str) -> Result<Device> {
        let refused = |reason| Error::Device { device: self.to_string(), reason };
        let Some(list) = there else {
            let reason = format!("this program was built without it: --features {feature}");
            return Err(refused(reason));
        };
        let devices = caught(list).map_err(refused)?;
        let count = devices.len();
        devices.into_iter().nth(n).ok_or_else(|| {
            refused(match count {
                0 => "there is no such device here, or no driver for it".to_owned(),
                _ => format!("there are {count} of its kind here, counted from 0"),
            })
        })
    }
}

type Enumerate = fn() -> Vec<Device>;

#[cfg(feature = "wgpu")]
fn wgpu() -> Option<Enumerate> {
    Some(|| Device::enumerate(burn::tensor::DeviceType::Wgpu).into_iter().collect())
}

#[cfg(not(feature = "wgpu"))]
fn wgpu() -> Option<Enumerate> {
    None
}

#[cfg(feature = "cuda")]
fn cuda() -> Option<Enumerate> {
    Some(|| Device::enumerate(burn::tensor::DeviceType::Cuda).into_iter().collect())
}

#[cfg(not(feature = "cuda"))]
fn cuda() -> Option<Enumerate> {
    None
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cpu => f.write_str("cpu"),
            Self::Wgpu(n) => write!(f, "wgpu:{n}"),
            Self::Cuda(n) => write!(f, "cuda:{n}"),
        }
    }
}

impl FromStr for DeviceChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, number) = text.split_once(':').unwrap_or((text, "0"));
        let number = number.parse().ok();
        match (kind, number) {
            ("cpu", _) if text == "cpu" => Ok(Self::Cpu),
            ("wgpu", Some(n)) => Ok(Self::Wgpu(n)),
            ("cuda", Some(n)) => Ok(Self::Cuda(n)),
            _ => Err("no device: `cpu`, `wgpu`, `cuda`, or the n-th, such as `cuda:1`".to_owned()),
        }
    }
}

/// What a device computes. burn panics where a device fails, for example without memory: elsewhere
/// than on the processor that becomes an error.
pub(crate) fn computed<T>(device: &Device, work: impl FnOnce() -> T) -> Result<T> {
    if *device == Device::flex() {
        return Ok(work());
    }
    caught(work).map_err(|reason| failed(device, reason))
}

/// The values of what is computed on a device, which says only then that it failed.
pub(crate) fn read<const D: usize>(
    device: &Device,
    work: impl FnOnce() -> Tensor<D>,
) -> Result<TensorData> {
    let data = computed(device, || work().try_into_data())?;
    data.map_err(|err| failed(device, line(&err.to_string())))
}

fn failed(device: &Device, reason: String) -> Error {
    let device = format!("{device:?}");
    let inner = device.strip_prefix("Device<Cube(").and_then(|it| it.strip_suffix(")>"));
    Error::Device { device: inner.unwrap_or(&device).to_owned(), reason }
}

/// What a device said, in one line: the innermost cause, if it told one.
fn line(text: &str) -> String {
    let cause = text.rsplit_once("Caused by:").map_or(text, |(_, cause)| cause);
    let line = cause.lines().map(str::trim).find(|line| !line.is_empty());
    vpr_files::shorten(line.unwrap_or("failed without a word"))
}

thread_local! {
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// What some work gives, or a line of what it panicked with, which is not printed then.
fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !IS_CAUGHT.get() && !is_of_a_device(thread::current().name()) {
                usual(info);
            }
        }));
    });
    let before = IS_CAUGHT.replace(true);
    let result = panic::catch_unwind(panic::AssertUnwindSafe(work));
    IS_CAUGHT.set(before);
    result.map_err(|payload| {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| payload.downcast_ref::<&str>().copied());
        line(text.unwrap_or_default())
    })
}

/// Whether burn runs the queue of a device on the thread of this name. What it panics with there is
/// told to whoever asks for the result.
fn is_of_a_device(thread: Option<&str>) -> bool {
    thread.is_some_and(|name| name.starts_with("DSU-") || name.starts_with("DSD-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_have_names() {
        for (text, choice) in [
            ("cpu", DeviceChoice::Cpu),
            ("wgpu", DeviceChoice::Wgpu(0)),
            ("wgpu:0", DeviceChoice::Wgpu(0)),
            ("cuda:3", DeviceChoice::Cuda(3)),
        ] {
            assert_eq!(text.parse(), Ok(choice));
            assert_eq!(choice.to_string().parse(), Ok(choice));
        }
        for text in ["", "gpu", "cpu:0", "cuda:", "cuda:-1", "wgpu:x", "cuda:1:2"] {
            assert!(text.parse::<DeviceChoice>().unwrap_err().contains("cuda:1"), "{text}");
        }
    }

    #[test]
    fn a_device_that_was_not_built_in_or_is_not_there_is_one_line() {
        assert_eq!(DeviceChoice::Cpu.open().unwrap(), Device::flex());
        for choice in [DeviceChoice::Wgpu(999), DeviceChoice::Cuda(999)] {
            let text = choice.open().unwrap_err().to_string();
            assert!(text.starts_with(&format!("device {choice}: ")), "{text}");
            assert_eq!(text.lines().count(), 1, "{text}");
        }
    }

    #[test]
    fn a_panic_of_a_device_is_an_error_and_one_of_the_processor_stays_one() {
        assert_eq!(caught(|| 3), Ok(3));
        assert_eq!(
            caught(|| panic!("out of memory\nat line 3")),
            Err::<(), _>("out of memory".into())
        );
        let text = "An error happened during execution\nCaused by:\n  out of memory\n  at line 3";
        assert_eq!(line(text), "out of memory");
        let own = panic::catch_unwind(|| computed(&Device::flex(), || panic!("ours")));
        assert!(own.is_err());
    }
}
