//! Writes checkpoints as PyTorch does, opcode by opcode.

use std::io::{Cursor, Write as _};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// A tensor of a checkpoint that is written.
pub(crate) struct Entry {
    pub(crate) key: &'static str,
    pub(crate) shape: Vec<u8>,
    pub(crate) strides: Vec<u8>,
    pub(crate) data: Vec<f32>,
}

/// A contiguous tensor.
pub(crate) fn entry(key: &'static str, shape: &[u8], data: &[f32]) -> Entry {
    let strides = (0..shape.len()).map(|axis| shape[axis + 1..].iter().product()).collect();
    Entry { key, shape: shape.to_vec(), strides, data: data.to_vec() }
}

fn text(out: &mut Vec<u8>, text: &str) {
    out.push(b'X');
    out.extend(u32::try_from(text.len()).unwrap().to_le_bytes());
    out.extend(text.as_bytes());
}

fn global(out: &mut Vec<u8>, module: &str, name: &str) {
    out.extend(format!("c{module}\n{name}\n").as_bytes());
}

fn tuple(out: &mut Vec<u8>, numbers: &[u8]) {
    out.push(b'(');
    for &number in numbers {
        out.extend([b'K', number]);
    }
    out.push(b't');
}

/// The pickle of an ordered dictionary of tensors, storages named by their position.
pub(crate) fn state_dict(entries: &[Entry], is_legacy: bool) -> Vec<u8> {
    let mut out = b"\x80\x02".to_vec();
    global(&mut out, "collections", "OrderedDict");
    out.extend(b")R(");
    for (index, entry) in entries.iter().enumerate() {
        text(&mut out, entry.key);
        global(&mut out, "torch._utils", "_rebuild_tensor_v2");
        out.extend(b"((");
        text(&mut out, "storage");
        global(&mut out, "torch", "FloatStorage");
        text(&mut out, &index.to_string());
        text(&mut out, "cpu");
        out.extend([b'K', u8::try_from(entry.data.len()).unwrap()]);
        if is_legacy {
            out.push(b'N');
        }
        out.extend(b"tQK\0");
        tuple(&mut out, &entry.shape);
        tuple(&mut out, &entry.strides);
        out.push(0x89);
        global(&mut out, "collections", "OrderedDict");
        out.extend(b")RtR");
    }
    // Its `_metadata`, which is set as the state of the dictionary.
    out.extend(b"u}");
    text(&mut out, "_metadata");
    out.extend(b"}sb.");
    out
}

/// A zip checkpoint with this pickle.
pub(crate) fn zip_of(pickle: &[u8], entries: &[Entry]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut add = |name: String, bytes: &[u8]| {
        zip.start_file(name, options).unwrap();
        zip.write_all(bytes).unwrap();
    };
    add("archive/data.pkl".to_owned(), pickle);
    for (index, entry) in entries.iter().enumerate() {
        let bytes: Vec<u8> = entry.data.iter().flat_map(|value| value.to_le_bytes()).collect();
        add(format!("archive/data/{index}"), &bytes);
    }
    add("archive/byteorder".to_owned(), b"little");
    zip.finish().unwrap().into_inner()
}

/// A checkpoint as PyTorch writes them since 1.6.
pub(crate) fn zip_checkpoint(entries: &[Entry]) -> Vec<u8> {
    zip_of(&state_dict(entries, false), entries)
}

/// A checkpoint as PyTorch wrote them before.
pub(crate) fn legacy_checkpoint(entries: &[Entry]) -> Vec<u8> {
    let mut out = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.".to_vec();
    out.extend(b"\x80\x02M\xe9\x03.");
    out.extend(b"\x80\x02}");
    text(&mut out, "little_endian");
    out.extend(b"\x88s.");
    out.extend(state_dict(entries, true));
    out.extend(b"\x80\x02](");
    (0..entries.len()).for_each(|index| text(&mut out, &index.to_string()));
    out.extend(b"e.");
    for entry in entries {
        out.extend((entry.data.len() as u64).to_le_bytes());
        out.extend(entry.data.iter().flat_map(|value| value.to_le_bytes()));
    }
    out
}

/// A `.safetensors` file.
pub(crate) fn safetensors(entries: &[Entry]) -> Vec<u8> {
    let bytes: Vec<Vec<u8>> =
        entries.iter().map(|it| it.data.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
    let views = entries.iter().zip(&bytes).map(|(entry, bytes)| {
        let shape = entry.shape.iter().map(|&side| usize::from(side)).collect();
        let dtype = safetensors::Dtype::F32;
        (entry.key, safetensors::tensor::TensorView::new(dtype, shape, bytes).unwrap())
    });
    safetensors::serialize(views, None).unwrap()
}
