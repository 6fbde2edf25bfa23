//! Conversion of numbers to bytes and back, bit for bit.

use sidestep::scene::JointState;
use sidestep::vehicle::{Pose, TurnInput};

/// Converts numbers to little-endian doubles.
#[must_use]
pub fn pack(numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let numbers = numbers.into_iter();
    let mut bytes = Vec::with_capacity(8 * numbers.size_hint().0);
    numbers.for_each(|number| bytes.extend_from_slice(&number.to_le_bytes()));
    bytes
}

/// The numbers that [`pack`] wrote. Ignores an incomplete number at the end.
#[must_use]
pub fn unpack(bytes: &[u8]) -> Vec<f64> {
    let (chunks, _) = bytes.as_chunks::<8>();
    chunks.iter().map(|&chunk| f64::from_le_bytes(chunk)).collect()
}

/// Converts each state to six doubles: x, y and heading of the human, and then of the robot.
#[must_use]
pub fn pack_states(states: &[JointState]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(48 * states.len());
    for state in states {
        for pose in [state.human, state.robot] {
            for number in <[f64; 3]>::from(pose) {
                bytes.extend_from_slice(&number.to_le_bytes());
            }
        }
    }
    bytes
}

/// The states that [`pack_states`] wrote.
#[must_use]
pub fn unpack_states(bytes: &[u8]) -> Vec<JointState> {
    let numbers = unpack(bytes);
    let (states, _) = numbers.as_chunks::<6>();
    let state = |&[a, b, c, d, e, f]: &[f64; 6]| JointState {
        human: Pose::from([a, b, c]),
        robot: Pose::from([d, e, f]),
    };
    states.iter().map(state).collect()
}

/// Converts each input to one signed byte: −1, 0 or 1.
#[must_use]
pub fn pack_inputs(inputs: &[TurnInput]) -> Vec<u8> {
    inputs.iter().map(|input| input.sign().cast_unsigned()).collect()
}

/// The inputs that [`pack_inputs`] wrote.
///
/// # Errors
/// [`Invalid`](sidestep::invalid::Invalid) if a byte is not −1, 0 or 1.
pub fn unpack_inputs(bytes: &[u8]) -> Result<Vec<TurnInput>, sidestep::invalid::Invalid> {
    bytes.iter().map(|byte| TurnInput::try_from(i64::from(byte.cast_signed()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_bit_comes_back() {
        let odd = [-0.0, f64::MIN_POSITIVE / 2.0, 0.1 + 0.2, -1e300];
        let again = unpack(&pack(odd));
        assert_eq!(again.map_bits(), odd.to_vec().map_bits());
        let states = [JointState {
            human: Pose::from([1.0, -2.5, 3.0]),
            robot: Pose::from([0.1, 0.2, -3.5]),
        }];
        assert_eq!(unpack_states(&pack_states(&states)), states);
        let inputs = TurnInput::ALL;
        assert_eq!(unpack_inputs(&pack_inputs(&inputs)).unwrap(), inputs);
        assert!(unpack_inputs(&[7]).is_err());
    }

    trait MapBits {
        fn map_bits(self) -> Vec<u64>;
    }
    impl MapBits for Vec<f64> {
        fn map_bits(self) -> Vec<u64> {
            self.into_iter().map(f64::to_bits).collect()
        }
    }
}
