//! H.264 by OpenH264, in the Constrained Baseline profile, which every player decodes.

use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, Profile, QpRange,
    RateControlMode, UsageType, VuiConfig,
};
use openh264::formats::YUVSlices;
use openh264::{OpenH264API, Timestamp};

use super::Quality;
use super::yuv::Yuv420;

/// The largest frame that OpenH264 encodes: long and short side in pixels.
pub(crate) const LARGEST: [u32; 2] = [3840, 2160];

/// The smallest side in pixels.
pub(crate) const SMALLEST: u32 = 16;

/// An encoder. Equal frames give equal bytes.
pub(crate) struct H264 {
    encoder: Encoder,
    fps: f64,
    encoded: u64,
    /// Sequence and picture parameter sets, available after the first frame.
    pub parameter_sets: [Vec<u8>; 2],
}

/// An encoded frame as stored in MP4: NAL units, each preceded by its length in four bytes (ISO/IEC 14496-15, 5.3).
pub(crate) struct EncodedFrame {
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Whether it is a key frame.
    pub is_key: bool,
}

impl H264 {
    /// An encoder for this number of frames per second.
    pub(crate) fn new(fps: f64, quality: Quality) -> Result<Self, openh264::Error> {
        // A constant quantiser instead of rate control. 6 more double the quantisation step.
        let step = match quality {
            Quality::High => 16,
            Quality::Low => 34,
        };
        let config = EncoderConfig::new()
            .profile(Profile::Baseline)
            .vui(VuiConfig::bt709())
            .usage_type(UsageType::CameraVideoRealTime)
            // Without scene change detection, this mode is limited by the range of quantisers alone.
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QpRange::new(step, step))
            // Required; the H.264 level is chosen by it.
            .bitrate(BitRate::from_bps(20_000_000))
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            // A key frame every two seconds, for seeking.
            .intra_frame_period(IntraFramePeriod::from_num_frames((2.0 * fps).ceil().max(1.0) as u32))
            .complexity(Complexity::Low)
            // No frame is dropped. Adaptation to camera noise has no use for rendered frames.
            .skip_frames(false)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(false)
            // With several threads the bytes would depend on their number.
            .num_threads(1);
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)?;
        Ok(H264 { encoder, fps, encoded: 0, parameter_sets: Default::default() })
    }

    /// Encodes the next frame.
    pub(crate) fn encode(&mut self, picture: &Yuv420) -> Result<EncodedFrame, openh264::Error> {
        let [width, height] = picture.size;
        let planes = YUVSlices::new(
            (&picture.y, &picture.u, &picture.v),
            (width, height),
            (width, width / 2, width / 2),
        );
        let time = Timestamp::from_millis((self.encoded as f64 * 1000.0 / self.fps) as u64);
        self.encoded += 1;
        let stream = self.encoder.encode_at(&planes, time)?;
        let is_key = stream.frame_type() == FrameType::IDR;
        let mut bytes = Vec::new();
        for layer in (0..stream.num_layers()).filter_map(|i| stream.layer(i)) {
            for unit in (0..layer.nal_count()).filter_map(|i| layer.nal_unit(i)) {
                // A start code of zeros and a one precedes each unit (ITU-T H.264, annex B).
                let start = 1 + unit.iter().position(|&byte| byte == 1).unwrap_or(0);
                let unit = &unit[start..];
                // The lower five bits are the type (table 7-1): 7 and 8 are parameter sets, which MP4 stores
                // separately.
                match unit.first().map(|byte| byte & 31) {
                    Some(7) => self.parameter_sets[0] = unit.to_vec(),
                    Some(8) => self.parameter_sets[1] = unit.to_vec(),
                    Some(_) => {
                        bytes.extend_from_slice(&(unit.len() as u32).to_be_bytes());
                        bytes.extend_from_slice(unit);
                    }
                    None => {}
                }
            }
        }
        Ok(EncodedFrame { bytes, is_key })
    }
}
