//! Orders of conditions that balance position effects and carry-over effects.

/// Number of participants after which the orders of `count` conditions repeat: `count` if it is
/// even, otherwise 2 · `count`.
#[must_use]
pub fn williams_block(count: usize) -> usize {
    if count.is_multiple_of(2) { count } else { 2 * count }
}

/// The order in which the participant at `place` (0, 1, 2, …) gets the conditions 0 … `count` − 1: a
/// row of a Williams square. Over a block of [`williams_block`] participants, each condition occurs
/// equally often at each position, and equally often directly after each other condition.
///
/// Williams, "Experimental designs balanced for the estimation of residual effects of treatments",
/// Australian Journal of Scientific Research A 2 (1949) 149–168.
#[must_use]
pub fn williams_order(count: usize, place: u64) -> Vec<usize> {
    let row = place_in(place, williams_block(count));
    // The first row is 0, 1, N − 1, 2, N − 2, … The differences between its neighbours are all
    // different (modulo N). Each further row is the previous row plus one (modulo N). For odd N,
    // the second half of the block consists of reversed rows.
    let mut order: Vec<usize> = (0..count)
        .map(|k| if k % 2 == 1 { k.div_ceil(2) } else { count - k / 2 })
        .map(|first| (first + row) % count)
        .collect();
    if row >= count {
        order.reverse();
    }
    order
}

/// `place` modulo `length`, or 0 if `length` is 0.
fn place_in(place: u64, length: usize) -> usize {
    (place % (length as u64).max(1)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_and_successions_are_balanced() {
        for count in 1..=13 {
            let block = williams_block(count);
            let mut positions = vec![vec![0; count]; count];
            let mut successions = vec![vec![0; count]; count];
            for place in 0..block as u64 {
                let order = williams_order(count, place);
                assert_eq!(order, williams_order(count, place + 7 * block as u64));
                for (position, condition) in order.iter().enumerate() {
                    positions[position][*condition] += 1;
                }
                for pair in order.windows(2) {
                    successions[pair[0]][pair[1]] += 1;
                }
            }
            let times = block / count;
            for a in 0..count {
                for b in 0..count {
                    assert_eq!(positions[a][b], times, "{count}");
                    assert_eq!(successions[a][b], if a == b { 0 } else { times }, "{count}");
                }
            }
        }
    }

    #[test]
    fn the_square_of_four() {
        let square: Vec<_> = (0..4).map(|place| williams_order(4, place)).collect();
        assert_eq!(square, [[0, 1, 3, 2], [1, 2, 0, 3], [2, 3, 1, 0], [3, 0, 2, 1]]);
        assert!(williams_order(0, 3).is_empty());
    }
}
