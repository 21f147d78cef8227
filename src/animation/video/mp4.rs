//! MP4: the boxes around encoded frames, with `moov` before `mdat` ("fast start").

use std::fs::File;
use std::io::{self, Seek, Write};
use std::path::Path;

use mp4_atom::{
    Avc1, Avcc, Co64, Codec, Colr, Dinf, Dref, Encode, Ftyp, Hdlr, Mdhd, Mdia, Minf, Moov, Mvhd, Stbl, Stco,
    Stsc, StscEntry, Stsd, Stss, Stsz, StszSamples, Stts, SttsEntry, Tkhd, Trak, Url, Visual, Vmhd,
};

use super::h264::EncodedFrame;

/// Ticks per frame: the frame rate may have three decimals.
const TICKS: u32 = 1000;

/// An MP4 file in the making. Encoded frames are kept in an unnamed temporary file until the size of the boxes before
/// them is known.
pub(crate) struct Mp4 {
    size: [u16; 2],
    timescale: u32,
    frames: io::BufWriter<File>,
    sizes: Vec<u32>,
    /// The numbers of the key frames, counted from 1.
    keys: Vec<u32>,
}

impl Mp4 {
    /// Begins a file with frames of this size and rate. The temporary file is created in `folder`.
    pub(crate) fn new(folder: &Path, size: [u16; 2], fps: f64) -> io::Result<Self> {
        let frames = io::BufWriter::new(tempfile::tempfile_in(folder)?);
        let timescale = (fps * f64::from(TICKS)).round().max(1.0) as u32;
        Ok(Mp4 { size, timescale, frames, sizes: Vec::new(), keys: Vec::new() })
    }

    /// Adds the next frame.
    pub(crate) fn add(&mut self, frame: &EncodedFrame) -> io::Result<()> {
        self.frames.write_all(&frame.bytes)?;
        self.sizes.push(frame.bytes.len() as u32);
        if frame.is_key {
            self.keys.push(self.sizes.len() as u32);
        }
        Ok(())
    }

    /// Writes the file.
    pub(crate) fn finish(self, parameter_sets: &[Vec<u8>; 2], out: &mut dyn Write) -> io::Result<()> {
        let ftyp = Ftyp {
            major_brand: b"isom".into(),
            minor_version: 512,
            compatible_brands: vec![b"isom".into(), b"iso2".into(), b"avc1".into(), b"mp41".into()],
        };
        let mut head = Vec::new();
        ftyp.encode(&mut head).map_err(io::Error::other)?;
        let bytes: u64 = self.sizes.iter().map(|&size| u64::from(size)).sum();
        // The header of `mdat`: length and name, and the length in eight bytes where four are not enough.
        let is_long = bytes > u64::from(u32::MAX) - 16;
        let mdat = if is_long { 16 } else { 8 };
        // The length of the boxes does not depend on the offset that they contain.
        let mut boxes = Vec::new();
        self.boxes(parameter_sets, is_long, 0)?.encode(&mut boxes).map_err(io::Error::other)?;
        let place = (head.len() + boxes.len()) as u64 + mdat;
        boxes.clear();
        self.boxes(parameter_sets, is_long, place)?.encode(&mut boxes).map_err(io::Error::other)?;
        head.extend_from_slice(&boxes);
        if is_long {
            head.extend_from_slice(&1u32.to_be_bytes());
            head.extend_from_slice(b"mdat");
            head.extend_from_slice(&(bytes + mdat).to_be_bytes());
        } else {
            head.extend_from_slice(&((bytes + mdat) as u32).to_be_bytes());
            head.extend_from_slice(b"mdat");
        }
        out.write_all(&head)?;
        let mut frames = self.frames.into_inner().map_err(io::IntoInnerError::into_error)?;
        frames.rewind()?;
        io::copy(&mut frames, out)?;
        Ok(())
    }

    /// The `moov` box, for frames that begin at byte `place` of the file (ISO/IEC 14496-12, chapter 8).
    fn boxes(&self, [sequence, picture]: &[Vec<u8>; 2], is_long: bool, place: u64) -> io::Result<Moov> {
        let count = self.sizes.len() as u32;
        let duration = u64::from(count) * u64::from(TICKS);
        let [width, height] = self.size;
        let avc1 = Avc1 {
            visual: Visual { data_reference_index: 1, width, height, ..Visual::default() },
            avcc: Avcc::new(sequence, picture).map_err(io::Error::other)?,
            // BT.709 primaries, transfer and matrix; not the full range (ITU-T H.273, tables 2 to 4).
            colr: Some(Colr::new(1, 1, 1, false).map_err(io::Error::other)?),
            ..Avc1::default()
        };
        let (stco, co64) = if is_long {
            (None, Some(Co64 { entries: vec![place] }))
        } else {
            (Some(Stco { entries: vec![place as u32] }), None)
        };
        let stbl = Stbl {
            stsd: Stsd { codecs: vec![Codec::Avc1(avc1)] },
            stts: Stts { entries: vec![SttsEntry { sample_count: count, sample_delta: TICKS }] },
            stss: Some(Stss { entries: self.keys.clone() }),
            stsc: Stsc {
                entries: vec![StscEntry {
                    first_chunk: 1,
                    samples_per_chunk: count,
                    sample_description_index: 1,
                }],
            },
            stsz: Stsz { samples: StszSamples::Different { sizes: self.sizes.clone() } },
            stco,
            co64,
            ..Stbl::default()
        };
        let dinf = Dinf { dref: Dref { entries: vec![Url::default().into()] } };
        let minf = Minf { vmhd: Some(Vmhd::default()), dinf, stbl, ..Minf::default() };
        let mdia = Mdia {
            mdhd: Mdhd { timescale: self.timescale, duration, language: "und".into(), ..Mdhd::default() },
            hdlr: Hdlr { handler: b"vide".into(), name: "VideoHandler".into() },
            minf,
        };
        let tkhd = Tkhd {
            track_id: 1,
            duration,
            enabled: true,
            in_movie: true,
            width: width.into(),
            height: height.into(),
            ..Tkhd::default()
        };
        Ok(Moov {
            mvhd: Mvhd {
                timescale: self.timescale,
                duration,
                rate: 1.into(),
                volume: 1.into(),
                next_track_id: 2,
                ..Mvhd::default()
            },
            trak: vec![Trak { tkhd, mdia, ..Trak::default() }],
            ..Moov::default()
        })
    }
}
