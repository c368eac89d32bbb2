//! Huffman-coded scans of sequential frames: how many bytes their units take.

/// Bits per symbol at most.
const MAX_BITS: usize = 16;

/// A component of the frame.
#[derive(Clone, Copy, Debug, Default)]
struct Component {
    id: u8,
    /// Blocks of one unit, horizontally and vertically.
    sampling: [usize; 2],
    /// Whether an earlier scan had it.
    seen: bool,
}

/// A table of Huffman codes: per length, the first code and its symbols.
#[derive(Clone, Debug, Default)]
struct Table {
    counts: [usize; MAX_BITS],
    symbols: Vec<u8>,
}

/// The blocks that a component has in a unit, and its tables.
type Part<'a> = (usize, [&'a Table; 2]);

/// How much of the coded data a scan takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Length {
    /// All units are there, in so many bytes.
    Whole(usize),
    /// Not all units are there.
    Short,
    /// The coding is another one, or its headers are not understood.
    Unknown,
}

/// What the headers before a scan say of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Scan {
    size: [usize; 2],
    components: Vec<Component>,
    is_sequential: bool,
    restart_interval: usize,
    n_scans: usize,
    /// By class (0 for the mean, 1 for the rest of a block) and number.
    tables: [[Table; 4]; 2],
}

impl Scan {
    /// Takes a segment of Huffman tables; what is malformed ends up as a scan that cannot be read.
    pub(super) fn tables(&mut self, mut segment: &[u8]) {
        while let Some((&which, rest)) = segment.split_first() {
            let Some((counts, rest)) = rest.split_first_chunk::<MAX_BITS>() else { return };
            let counts = counts.map(usize::from);
            let Some((symbols, rest)) = rest.split_at_checked(counts.iter().sum()) else { return };
            let table = Table { counts, symbols: symbols.to_vec() };
            if let Some(slot) = self
                .tables
                .get_mut(usize::from(which >> 4))
                .and_then(|class| class.get_mut(usize::from(which & 15)))
            {
                *slot = table;
            }
            segment = rest;
        }
    }

    /// Takes the number of units between restarts.
    pub(super) fn restart_interval(&mut self, segment: &[u8]) {
        let interval = segment.first_chunk::<2>().map(|it| u16::from_be_bytes(*it));
        self.restart_interval = interval.map_or(0, usize::from);
    }

    /// Takes the header of a frame.
    pub(super) fn frame(&mut self, segment: &[u8], is_sequential: bool) {
        let [_, h1, h2, w1, w2, _, components @ ..] = segment else { return };
        self.size = [[*h1, *h2], [*w1, *w2]].map(|it| usize::from(u16::from_be_bytes(it)));
        let component = |it: &[u8; 3]| Component {
            id: it[0],
            sampling: [usize::from(it[1] >> 4), usize::from(it[1] & 15)],
            seen: false,
        };
        self.components = components.as_chunks().0.iter().map(component).collect();
        self.is_sequential = is_sequential;
    }

    /// Notes that a scan with this header begins.
    pub(super) fn begin(&mut self, header: &[u8]) {
        self.n_scans += 1;
        for (id, _) in selectors(header) {
            self.components.iter_mut().filter(|it| it.id == id).for_each(|it| it.seen = true);
        }
    }

    /// Whether there was a scan.
    pub(super) fn has_begun(&self) -> bool {
        self.n_scans > 0
    }

    /// Whether every component had a scan.
    pub(super) fn is_last(&self) -> bool {
        self.components.iter().all(|it| it.seen)
    }

    /// The bytes that the units of a scan take, with the rest of the last byte.
    pub(super) fn length(&self, header: &[u8], coded: &[u8]) -> Length {
        let Some((n_units, parts)) = self.units(header) else { return Length::Unknown };
        let mut bits = Bits { bytes: coded, at: 0, buffer: 0, n: 0 };
        let mut unit = |unit: usize| {
            if self.restart_interval > 0 && unit > 0 && unit.is_multiple_of(self.restart_interval) {
                bits.restart()?;
            }
            for &(n_blocks, tables) in &parts {
                for _ in 0..n_blocks {
                    block(&mut bits, tables)?;
                }
            }
            Some(())
        };
        match (0..n_units).try_for_each(&mut unit) {
            Some(()) => Length::Whole(bits.at),
            None => Length::Short,
        }
    }

    /// How many units a scan has, and per component the blocks of a unit and their tables.
    fn units(&self, header: &[u8]) -> Option<(usize, Vec<Part<'_>>)> {
        let max = |axis: usize| self.components.iter().map(|it| it.sampling[axis]).max();
        let (horizontal, vertical) = (max(0)?, max(1)?);
        let [height, width] = self.size;
        if !self.is_sequential || height * width * horizontal * vertical == 0 {
            return None;
        }
        let selected: Vec<(&Component, [&Table; 2])> = selectors(header)
            .map(|(id, tables)| {
                let component = self.components.iter().find(|it| it.id == id)?;
                let table = |class: usize, number: u8| self.tables[class].get(usize::from(number));
                Some((component, [table(0, tables >> 4)?, table(1, tables & 15)?]))
            })
            .collect::<Option<_>>()?;
        if let [(component, tables)] = selected[..] {
            // A single component has its own grid of blocks.
            let own = |size: usize, sampling: usize, max: usize| {
                (size * sampling).div_ceil(max).div_ceil(8)
            };
            let [x, y] = component.sampling;
            let n_units = own(width, x, horizontal) * own(height, y, vertical);
            return Some((n_units, vec![(1, tables)]));
        }
        let n_units = width.div_ceil(8 * horizontal) * height.div_ceil(8 * vertical);
        let part = |(component, tables): (&Component, _)| {
            (component.sampling[0] * component.sampling[1], tables)
        };
        let parts: Vec<_> = selected.into_iter().map(part).collect();
        (!parts.is_empty()).then_some((n_units, parts))
    }
}

/// The components of a scan and their tables, from its header.
fn selectors(header: &[u8]) -> impl Iterator<Item = (u8, u8)> {
    let n = header.first().copied().map_or(0, usize::from);
    let pairs = header.get(1..).unwrap_or_default().as_chunks::<2>().0;
    pairs.iter().take(n).map(|&[id, tables]| (id, tables))
}

/// Reads over one block of 64 coefficients.
fn block(bits: &mut Bits<'_>, [mean, rest]: [&Table; 2]) -> Option<()> {
    let size = bits.symbol(mean)?;
    bits.skip(usize::from(size.min(16)))?;
    let mut at = 1;
    while at < 64 {
        let symbol = bits.symbol(rest)?;
        let (run, size) = (usize::from(symbol >> 4), usize::from(symbol & 15));
        match (run, size) {
            (0, 0) => return Some(()),
            (15, 0) => at += 16,
            _ => {
                bits.skip(size)?;
                at += run + 1;
            }
        }
    }
    // A run that leaves the block is no code.
    (at == 64).then_some(())
}

/// Coded data bit by bit, without the zeros that are stuffed behind bytes of ones.
struct Bits<'a> {
    bytes: &'a [u8],
    /// The next byte to read.
    at: usize,
    buffer: u8,
    n: u8,
}

impl Bits<'_> {
    fn bit(&mut self) -> Option<u8> {
        if self.n == 0 {
            let byte = *self.bytes.get(self.at)?;
            self.at += 1;
            if byte == 0xFF {
                // A marker ends the data.
                if *self.bytes.get(self.at)? != 0 {
                    return None;
                }
                self.at += 1;
            }
            (self.buffer, self.n) = (byte, 8);
        }
        self.n -= 1;
        Some(self.buffer >> self.n & 1)
    }

    fn skip(&mut self, n: usize) -> Option<()> {
        (0..n).try_for_each(|_| self.bit().map(drop))
    }

    fn symbol(&mut self, table: &Table) -> Option<u8> {
        let (mut code, mut first, mut index) = (0_usize, 0_usize, 0_usize);
        for count in table.counts {
            code |= usize::from(self.bit()?);
            if code < first + count {
                return table.symbols.get(index + (code - first)).copied();
            }
            index += count;
            first = (first + count) << 1;
            code <<= 1;
        }
        None
    }

    /// Goes behind the restart marker that stands here.
    fn restart(&mut self) -> Option<()> {
        self.n = 0;
        match self.bytes.get(self.at..)? {
            [0xFF, 0xD0..=0xD7, ..] => {
                self.at += 2;
                Some(())
            }
            _ => None,
        }
    }
}
