//! Writes `ground_truth_new.npy`: NumPy's pickled array of `[query, list of references]`.

use vpr_core::GroundTruth;

/// The bytes of the file; a new place has the list `[-1]`.
pub(crate) fn ground_truth_npy(truth: &GroundTruth) -> Vec<u8> {
    let n = i32::try_from(truth.len()).expect("recipes allow 40 000 queries");
    let header = format!("{{'descr': '|O', 'fortran_order': False, 'shape': ({n}, 2), }}");
    // Magic, version, length: the data starts at a multiple of 64 bytes.
    let padded = (header.len() + 1 + 10).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let length = u16::try_from(padded).expect("the header is short");
    bytes.extend(length.to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.resize(10 + padded - 1, b' ');
    bytes.push(b'\n');
    // Protocol 3; _reconstruct(ndarray, (0,), b"b").
    bytes.extend(
        b"\x80\x03cnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85C\x01b\x87R",
    );
    // State: version 1, shape, dtype("O8"), C order, items.
    bytes.extend(b"(K\x01");
    push_int(&mut bytes, n);
    bytes.extend(b"K\x02\x86cnumpy\ndtype\nX\x02\x00\x00\x00O8\x89\x88\x87R");
    bytes.extend(b"(K\x03X\x01\x00\x00\x00|NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x3ftb\x89](");
    for query in 0..truth.len() {
        push_int(&mut bytes, query as i32);
        bytes.extend(b"](");
        if truth.is_new_place(query) {
            push_int(&mut bytes, -1);
        }
        for &reference in truth.correct(query) {
            push_int(
                &mut bytes,
                i32::try_from(reference).expect("recipes allow 40 000 references"),
            );
        }
        bytes.push(b'e');
    }
    bytes.extend(b"etb.");
    bytes
}

fn push_int(bytes: &mut Vec<u8>, value: i32) {
    bytes.push(b'J');
    bytes.extend(value.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use vpr_data::layout::vpr_bench::GroundTruthFile;

    use super::*;

    #[test]
    fn the_reader_of_real_files_reads_it_back() {
        let lists = vec![vec![0, 1, 2], vec![], vec![299], vec![7]];
        let truth = GroundTruth::from_lists(lists, 300).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ground_truth_new.npy");
        std::fs::write(&path, ground_truth_npy(&truth)).unwrap();
        assert_eq!(GroundTruthFile::read(&path).unwrap().truth(300).unwrap(), (truth, 0));
    }
}
