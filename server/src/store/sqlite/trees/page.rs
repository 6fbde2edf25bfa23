//! The layout of a b-tree page.

/// Size of the file header (bytes). The header is at the beginning of the first page.
pub(super) const HEADER: usize = 100;

pub(super) const INNER: u8 = 5;
pub(super) const LEAF: u8 = 13;

/// Offset of the b-tree header in a page.
pub(super) fn header_in(page: u32) -> usize {
    if page == 1 { HEADER } else { 0 }
}

/// Number of rows on a leaf page.
pub(super) fn rows_in(content: &[u8]) -> usize {
    usize::from(u16::from_be_bytes([content[3], content[4]]))
}

/// The serial types of the values of a record. Returns `None` if they do not match the record's length.
pub(super) fn types(record: &[u8], length: u64) -> Option<Vec<u64>> {
    let mut rest = record;
    let head = varint(&mut rest)?;
    let head_length = usize::try_from(head).ok()?;
    let mut rest = record.get(record.len() - rest.len()..head_length)?;
    let (mut types, mut total) = (Vec::new(), head);
    while !rest.is_empty() {
        let of_value = varint(&mut rest)?;
        types.push(of_value);
        let bytes = match of_value {
            0 | 8 | 9 => 0,
            1..=4 => of_value,
            5 => 6,
            6 | 7 => 8,
            10 | 11 => return None,
            _ => (of_value - 12) / 2,
        };
        total = total.checked_add(bytes)?;
    }
    (total == length).then_some(types)
}

/// The children of an interior page: each child with the rowid of its last row, and then the rightmost
/// child.
pub(super) fn below(header: &[u8], content: &[u8]) -> Option<(Vec<(i64, u32)>, u32)> {
    let count = usize::from(u16::from_be_bytes([*header.get(3)?, *header.get(4)?]));
    let pages = header.get(12..)?.chunks_exact(2).take(count).map(|at| {
        let mut cell = content.get(usize::from(u16::from_be_bytes([at[0], at[1]]))..)?;
        let page = number(cell)?;
        cell = &cell[4..];
        Some((varint(&mut cell)? as i64, page))
    });
    Some((pages.collect::<Option<Vec<_>>>()?, number(header.get(8..)?)?))
}

pub(super) fn is_ascending(before: i64, below: &[(i64, u32)], last: i64) -> bool {
    let numbers = || below.iter().map(|(number, _)| *number);
    std::iter::once(before)
        .chain(numbers())
        .zip(numbers().chain([last]))
        .all(|(one, next)| one < next)
}

/// An interior page whose children are the pages `below`. It replaces the page `content`, and keeps the
/// first `header` bytes of that page.
pub(super) fn inner(below: &[(i64, u32)], content: &[u8], header: usize) -> Vec<u8> {
    let mut page = content[..header].to_vec();
    page.resize(content.len(), 0);
    let mut end = page.len();
    let Some(((_, right), cells)) = below.split_last() else { return page };
    for (at, (last, below)) in cells.iter().enumerate() {
        let mut cell = below.to_be_bytes().to_vec();
        push_varint(&mut cell, *last as u64);
        end -= cell.len();
        page[end..][..cell.len()].copy_from_slice(&cell);
        page[header + 12 + 2 * at..][..2].copy_from_slice(&(end as u16).to_be_bytes());
    }
    page[header] = INNER;
    page[header + 3..][..2].copy_from_slice(&(cells.len() as u16).to_be_bytes());
    page[header + 5..][..2].copy_from_slice(&(end as u16).to_be_bytes());
    page[header + 8..][..4].copy_from_slice(&right.to_be_bytes());
    page
}

pub(super) fn number(bytes: &[u8]) -> Option<u32> {
    bytes.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

/// SQLite's varint: up to nine bytes, big-endian; every byte but the last has its high bit set.
pub(super) fn varint(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    for at in 0..9 {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        if at == 8 {
            return Some(number << 8 | u64::from(byte));
        }
        number = number << 7 | u64::from(byte & 0x7f);
        if byte < 0x80 {
            break;
        }
    }
    Some(number)
}

pub(super) fn push_varint(to: &mut Vec<u8>, number: u64) {
    let mut rest = number;
    let mut bytes = Vec::new();
    if number >= 1 << 56 {
        bytes.push(rest as u8);
        rest >>= 8;
        bytes.extend((0..8).map(|at| (rest >> (7 * at)) as u8 | 0x80));
    } else {
        bytes.push(rest as u8 & 0x7f);
        while rest >= 0x80 {
            rest >>= 7;
            bytes.push(rest as u8 & 0x7f | 0x80);
        }
    }
    to.extend(bytes.iter().rev());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_length_that_they_need() {
        for number in [0, 1, 127, 128, 16_383, 16_384, (1 << 56) - 1, 1 << 56, u64::MAX] {
            let mut bytes = Vec::new();
            push_varint(&mut bytes, number);
            let bits = 64 - number.max(1).leading_zeros() as usize;
            assert_eq!(bytes.len(), bits.div_ceil(7).min(9), "{number}");
            let mut rest = &bytes[..];
            assert!(varint(&mut rest) == Some(number) && rest.is_empty(), "{number}");
            assert_eq!(varint(&mut &bytes[..bytes.len() - 1]), None);
        }
    }
}
