//! Solutions stored as NumPy archives.

use super::*;

fn march<T: Real>(slices: usize) -> Solution<T, 2> {
    let game = DoubleIntegrator { acceleration_mps2: 1.0 };
    let target = |[x, v]: [f64; 2]| hypot(x, v) - 0.5;
    let axes = [Axis::bounded(-2.0, 2.0, 17), Axis::periodic(-1.0, 2.0, 12)];
    let problem = problem(&game, axes, &target, (Kind::Tube, FORWARD), 0.5);
    solved(&problem, &settings(Scheme::Eno2).with_slices(slices))
}

#[test]
fn a_solution_survives_a_file() {
    let (single, double) = (march::<f32>(3), march::<f64>(0));
    let bytes = single.npz().unwrap();
    assert_eq!(Solution::<f32, 2>::from_npz(&bytes).unwrap(), single);
    assert_eq!(single.npz().unwrap(), bytes);
    assert_eq!(Solution::<f64, 2>::from_npz(&double.npz().unwrap()).unwrap(), double);
}

#[test]
fn other_bytes_are_refused_by_name() {
    let bytes = march::<f32>(1).npz().unwrap();
    let refused = |bytes: &[u8]| Solution::<f32, 2>::from_npz(bytes).unwrap_err().to_string();
    assert_eq!(refused(b""), "bytes: expected a NumPy archive (.npz), found other bytes");
    assert_eq!(
        Solution::<f64, 2>::from_npz(&bytes).unwrap_err().to_string(),
        "value: expected dtype <f8, found <f4"
    );
    let axes = Solution::<f32, 3>::from_npz(&bytes).unwrap_err().to_string();
    assert_eq!(axes, "meta.axes: expected 3 axes, found 2");
    let changed = |from: &[u8], to: &[u8]| {
        let mut bytes = bytes.clone();
        let places = (0..bytes.len() - from.len()).filter(|&at| bytes[at..].starts_with(from));
        for at in places.collect::<Vec<_>>() {
            bytes[at..at + to.len()].copy_from_slice(to);
        }
        refused(&bytes)
    };
    // The checksums do not match the changed bytes.
    let damaged = |name: &str| format!("{name}: expected bytes that match the archive's checksum");
    assert!(changed(b"npz/1", b"npz/2").starts_with(&damaged("meta")));
    assert!(
        changed(b"value.npy", b"other.npy").starts_with("value: expected an array of this name")
    );
    assert!(changed(b"(2, 17, 12,", b"(2, 12, 17,").starts_with(&damaged("value")));
    let longer = [&bytes[..], b"more"].concat();
    assert!(refused(&longer).contains("bytes after its end"));
}

/// A change of any bit of an array's numbers or header is detected.
#[test]
fn damaged_arrays_are_refused() {
    let whole = march::<f32>(1);
    let bytes = whole.npz().unwrap();
    let mut changed = 0;
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x40;
        // Damage that is not detected is in metadata, such as the archive's time.
        if let Ok(solution) = Solution::<f32, 2>::from_npz(&damaged) {
            assert_eq!(solution, whole, "byte {at}");
            changed += 1;
        }
    }
    // For each of the seven arrays, ZIP has two records with such metadata, together 76 bytes
    // without names.
    assert!(changed <= 7 * 76, "{changed} of {}", bytes.len());
}

/// No damage causes a panic.
#[test]
fn damaged_bytes_do_no_harm() {
    let bytes = march::<f32>(0).npz().unwrap();
    for end in 0..bytes.len() {
        let _ = Solution::<f32, 2>::from_npz(&bytes[..end]).unwrap_err();
    }
    let mut rng = SeededRng::new(2);
    let mut refused = 0;
    for _ in 0..20_000 {
        let mut damaged = bytes.clone();
        for _ in 0..1 + rng.below(3) {
            let at = rng.below(damaged.len());
            damaged[at] = rng.below(256) as u8;
        }
        refused += usize::from(Solution::<f32, 2>::from_npz(&damaged).is_err());
    }
    assert!(refused > 2000, "{refused}");
}
