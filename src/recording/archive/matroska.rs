//! Reads the frame of a Matroska stream: where clusters begin, and the times of the blocks in them.
//!
//! Bytes go in as they come, a byte or a megabyte at once; whole blocks come out. The same code follows a file while it
//! is written and reads on in it after a crash, so both say the same. Only what `media::Muxer` writes is understood:
//! anything else is a fault, which is how the end of what can be read is found. What a block holds is stepped over, and
//! nothing is set aside by a length that was read.
//!
//! \[RFC8794\] Extensible Binary Meta Language, <https://www.rfc-editor.org/rfc/rfc8794>.
//! \[RFC9559\] Matroska, <https://www.rfc-editor.org/rfc/rfc9559>.

use crate::media::TICK_NANOS;

/// Most bytes of an element's head \[RFC8794\] sections 4 and 5: four of the id, eight of the size.
const MAX_HEAD_BYTES: usize = 12;

/// Most bytes of an element that are looked at; the longest are the names of codecs.
const MAX_LOOK_BYTES: usize = 32;

/// Bytes of a block that say its time: track number, 16 bits of time, flags \[RFC9559\] section 10.
const BLOCK_HEAD_BYTES: u64 = 11;

/// Bytes that are none of ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no Matroska of this program from byte {offset} on")]
pub(super) struct Malformed {
    /// Where the element begins that is at fault.
    pub offset: u64,
}

/// A whole block: one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// Its time in the stream, nanoseconds.
    pub nanos: i64,
    /// Whether decoding can begin with it.
    pub is_key: bool,
    /// Where its cluster begins.
    pub cluster_offset: u64,
    /// Whether it is its cluster's first.
    pub leads_cluster: bool,
    /// The byte behind it.
    pub end: u64,
}

/// What a header says of the stream.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Header {
    /// The codec as Matroska names it.
    pub codec: String,
    /// Columns and rows.
    pub size_px: (u32, u32),
}

/// Follows a stream.
#[derive(Clone, Debug)]
pub(super) struct Walker {
    place: Place,
    step: Step,
    /// Bytes of the element that is being read, as far as they are looked at.
    look: Vec<u8>,
    /// The next byte.
    position: u64,
    /// Where the element that is being read begins.
    element_at: u64,
    header: Header,
    header_bytes: Option<u64>,
    cluster: Option<Cluster>,
    group: Option<Group>,
    /// The byte behind the last whole block.
    whole_bytes: u64,
    fault: Option<Malformed>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The first element is to come.
    Start,
    /// Before the first cluster.
    Header,
    /// In a cluster.
    Cluster,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Key,
    Delta,
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Head,
    /// The rest of an element: how much of it is looked at, and how much is stepped over.
    Body {
        id: u32,
        look: usize,
        left: u64,
    },
}

#[derive(Clone, Copy, Debug)]
struct Cluster {
    offset: u64,
    ticks: Option<i64>,
    n_blocks: u64,
}

/// A block with its companions, where it is no simple one.
#[derive(Clone, Copy, Debug)]
struct Group {
    end: u64,
    ticks: Option<i64>,
    refers: bool,
}

mod id {
    //! Names of elements, \[RFC9559\] section 5.
    pub(super) const EBML: u32 = 0x1a45_dfa3;
    pub(super) const SEGMENT: u32 = 0x1853_8067;
    pub(super) const INFO: u32 = 0x1549_a966;
    pub(super) const TIMESTAMP_SCALE: u32 = 0x002a_d7b1;
    pub(super) const TRACKS: u32 = 0x1654_ae6b;
    pub(super) const TRACK_ENTRY: u32 = 0xae;
    pub(super) const CODEC_ID: u32 = 0x86;
    pub(super) const VIDEO: u32 = 0xe0;
    pub(super) const PIXEL_WIDTH: u32 = 0xb0;
    pub(super) const PIXEL_HEIGHT: u32 = 0xba;
    pub(super) const CLUSTER: u32 = 0x1f43_b675;
    pub(super) const TIMESTAMP: u32 = 0xe7;
    pub(super) const SIMPLE_BLOCK: u32 = 0xa3;
    pub(super) const BLOCK_GROUP: u32 = 0xa0;
    pub(super) const BLOCK: u32 = 0xa1;
    pub(super) const REFERENCE_BLOCK: u32 = 0xfb;
    /// Stands in a cluster and says nothing that is needed: position, size of the one before, void, checksum, duration,
    /// additions, padding.
    pub(super) const BESIDE: [u32; 7] = [0xa7, 0xab, 0xec, 0xbf, 0x9b, 0x75a1, 0x75a2];
}

impl Walker {
    /// A walker at the beginning of a stream.
    pub(super) fn new() -> Self {
        Self::at(0, Place::Start)
    }

    /// A walker at the beginning of the cluster at `offset`.
    pub(super) fn at_cluster(offset: u64) -> Self {
        Self::at(offset, Place::Header)
    }

    fn at(offset: u64, place: Place) -> Self {
        Self {
            place,
            step: Step::Head,
            look: Vec::with_capacity(MAX_LOOK_BYTES),
            position: offset,
            element_at: offset,
            header: Header::default(),
            header_bytes: None,
            cluster: None,
            group: None,
            whole_bytes: offset,
            fault: None,
        }
    }

    /// What the header says, as far as it was read.
    pub(super) const fn header(&self) -> &Header {
        &self.header
    }

    /// Bytes before the first cluster that was met, once it was.
    pub(super) const fn header_bytes(&self) -> Option<u64> {
        self.header_bytes
    }

    /// The byte behind the last whole block.
    pub(super) const fn whole_bytes(&self) -> u64 {
        self.whole_bytes
    }

    /// Reads on; `meet` gets every block that is whole now.
    ///
    /// # Errors
    /// When the bytes are none of ours; nothing more is read then.
    pub(super) fn feed(&mut self, bytes: &[u8], meet: &mut impl FnMut(Block)) -> Result<(), Malformed> {
        if let Some(fault) = self.fault {
            return Err(fault);
        }
        let fed = self.walk(bytes, meet);
        self.fault = fed.err();
        fed
    }

    fn walk(&mut self, mut rest: &[u8], meet: &mut impl FnMut(Block)) -> Result<(), Malformed> {
        while !rest.is_empty() {
            match self.step {
                Step::Head => {
                    self.look.push(rest[0]);
                    self.advance(1, &mut rest);
                    match read_head(&self.look) {
                        Head::Short => {}
                        Head::Wrong => return Err(self.malformed()),
                        Head::Whole { id, size } => self.begin(id, size)?,
                    }
                }
                Step::Body { id, look, left } if self.look.len() < look => {
                    let n = (look - self.look.len()).min(rest.len());
                    self.look.extend_from_slice(&rest[..n]);
                    self.advance(n, &mut rest);
                    self.step = Step::Body { id, look, left: left - n as u64 };
                }
                Step::Body { id, look, left } => {
                    let n = usize::try_from(left).unwrap_or(usize::MAX).min(rest.len());
                    self.advance(n, &mut rest);
                    self.step = Step::Body { id, look, left: left - n as u64 };
                }
            }
            // An element may be empty: its end can fall together with its head's.
            if let Step::Body { id, left: 0, .. } = self.step {
                self.end(id, meet)?;
            }
        }
        Ok(())
    }

    fn advance(&mut self, n: usize, rest: &mut &[u8]) {
        self.position = self.position.saturating_add(n as u64);
        *rest = &rest[n..];
    }

    const fn malformed(&self) -> Malformed {
        Malformed { offset: self.element_at }
    }

    /// The head of an element was read: `size` is that of its body, none where it ends with what follows.
    fn begin(&mut self, id: u32, size: Option<u64>) -> Result<(), Malformed> {
        let is_entered = match (self.place, id) {
            (Place::Start, id::EBML) => {
                self.place = Place::Header;
                false
            }
            (Place::Start, _) => return Err(self.malformed()),
            (Place::Header, id::SEGMENT | id::INFO | id::TRACKS | id::TRACK_ENTRY | id::VIDEO) => true,
            (_, id::CLUSTER) => {
                self.header_bytes.get_or_insert(self.element_at);
                self.place = Place::Cluster;
                self.cluster = Some(Cluster { offset: self.element_at, ticks: None, n_blocks: 0 });
                true
            }
            (Place::Header, _) => false,
            (Place::Cluster, id::BLOCK_GROUP) => {
                let size = size.ok_or(self.malformed())?;
                let end = self.position.saturating_add(size);
                self.group = Some(Group { end, ticks: None, refers: false });
                true
            }
            (Place::Cluster, id::TIMESTAMP | id::SIMPLE_BLOCK | id::BLOCK | id::REFERENCE_BLOCK) => false,
            (Place::Cluster, id) if id::BESIDE.contains(&id) => false,
            (Place::Cluster, _) => return Err(self.malformed()),
        };
        self.look.clear();
        if is_entered {
            self.element_at = self.position;
            self.step = Step::Head;
            return Ok(());
        }
        let size = size.ok_or(self.malformed())?;
        let look = match id {
            id::SIMPLE_BLOCK | id::BLOCK => size.min(BLOCK_HEAD_BYTES) as usize,
            _ if size <= MAX_LOOK_BYTES as u64 => size as usize,
            _ => 0,
        };
        self.step = Step::Body { id, look, left: size };
        Ok(())
    }

    /// The body of an element was read.
    fn end(&mut self, id: u32, meet: &mut impl FnMut(Block)) -> Result<(), Malformed> {
        match id {
            id::TIMESTAMP_SCALE if number(&self.look) != TICK_NANOS.unsigned_abs() => {
                return Err(self.malformed());
            }
            id::CODEC_ID => {
                // Texts may be filled up with zeros [RFC8794] section 7.4.
                self.header.codec = String::from_utf8_lossy(&self.look).trim_end_matches('\0').to_owned();
            }
            id::PIXEL_WIDTH => self.header.size_px.0 = side(&self.look),
            id::PIXEL_HEIGHT => self.header.size_px.1 = side(&self.look),
            id::TIMESTAMP => {
                let ticks = i64::try_from(number(&self.look)).unwrap_or(i64::MAX);
                let cluster = self.cluster.as_mut().ok_or(Malformed { offset: self.element_at })?;
                cluster.ticks = Some(ticks);
            }
            id::SIMPLE_BLOCK => {
                let (ticks, flags) = self.block_time()?;
                // The highest of the flags' bits [RFC9559] section 10.2.
                let kind = if flags & 0x80 == 0 { Kind::Delta } else { Kind::Key };
                self.meet(ticks, kind, meet)?;
            }
            id::BLOCK => {
                let (ticks, _flags) = self.block_time()?;
                let group = self.group.as_mut().ok_or(Malformed { offset: self.element_at })?;
                group.ticks = Some(ticks);
            }
            id::REFERENCE_BLOCK => {
                let group = self.group.as_mut().ok_or(Malformed { offset: self.element_at })?;
                group.refers = true;
            }
            _ => {}
        }
        if let Some(Group { ticks, refers, .. }) = self.group.take_if(|group| self.position >= group.end) {
            let ticks = ticks.ok_or(Malformed { offset: self.element_at })?;
            self.meet(ticks, if refers { Kind::Delta } else { Kind::Key }, meet)?;
        }
        self.look.clear();
        self.step = Step::Head;
        self.element_at = self.position;
        Ok(())
    }

    /// Time and flags of the block whose first bytes were looked at.
    fn block_time(&self) -> Result<(i64, u8), Malformed> {
        let n_track = self.look.first().map_or(9, |first| first.leading_zeros() as usize + 1);
        let Some(&[high, low, flags]) = self.look.get(n_track..n_track + 3) else {
            return Err(self.malformed());
        };
        let base = self.cluster.and_then(|cluster| cluster.ticks).ok_or(self.malformed())?;
        Ok((base.saturating_add(i64::from(i16::from_be_bytes([high, low]))), flags))
    }

    fn meet(&mut self, ticks: i64, kind: Kind, meet: &mut impl FnMut(Block)) -> Result<(), Malformed> {
        let cluster = self.cluster.as_mut().ok_or(Malformed { offset: self.element_at })?;
        // Hundreds of years: no time of ours, and what is added to it would not fit.
        let nanos = ticks.checked_mul(TICK_NANOS).ok_or(Malformed { offset: self.element_at })?;
        cluster.n_blocks += 1;
        self.whole_bytes = self.position;
        meet(Block {
            nanos,
            is_key: kind == Kind::Key,
            cluster_offset: cluster.offset,
            leads_cluster: cluster.n_blocks == 1,
            end: self.position,
        });
        Ok(())
    }
}

enum Head {
    Short,
    Wrong,
    Whole { id: u32, size: Option<u64> },
}

/// Reads an id and a size, each as long as the zeros before its first bit say \[RFC8794\] section 4.
fn read_head(bytes: &[u8]) -> Head {
    let n_id = bytes.first().map_or(0, |first| first.leading_zeros() as usize + 1);
    if n_id > 4 || bytes.len() > MAX_HEAD_BYTES {
        return Head::Wrong;
    }
    let Some(first_of_size) = bytes.get(n_id) else { return Head::Short };
    let n_size = first_of_size.leading_zeros() as usize + 1;
    if n_size > 8 {
        return Head::Wrong;
    }
    let Some(size) = bytes.get(n_id..n_id + n_size) else { return Head::Short };
    let id = number(&bytes[..n_id]) as u32;
    let mask = u64::MAX >> (64 - 7 * n_size as u32);
    let size = number(size) & mask;
    // All ones: the size is unknown.
    Head::Whole { id, size: (size != mask).then_some(size) }
}

/// A number of at most eight bytes, the highest first; of more the last eight count.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0, |number, byte| number << 8 | u64::from(*byte))
}

fn side(bytes: &[u8]) -> u32 {
    u32::try_from(number(bytes)).unwrap_or(0).min(65_536)
}

#[cfg(test)]
pub(super) mod tests;
