//! H.264 by OpenH264: Constrained Baseline, which every player decodes.

use openh264::encoder::{
    BitRate, Complexity, Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, Profile, QpRange,
    RateControlMode, UsageType, VuiConfig,
};
use openh264::formats::YUVSlices;
use openh264::{OpenH264API, Timestamp};

use super::Quality;
use super::yuv::Yuv420;

/// The largest picture that OpenH264 encodes: long and short side.
pub const LARGEST: [u32; 2] = [3840, 2160];

/// The smallest side.
pub const SMALLEST: u32 = 16;

/// Encodes pictures one after the other. The same pictures give the same bytes.
pub struct H264 {
    encoder: Encoder,
    fps: f64,
    encoded: u64,
    /// Sequence and picture parameter sets, once there are pictures.
    pub parameter_sets: [Vec<u8>; 2],
}

/// An encoded picture, in the form of MP4: units, each after its length in four bytes (ISO/IEC 14496-15, 5.3).
pub struct Sample {
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Whether decoding can begin with it.
    pub is_key: bool,
}

impl H264 {
    /// An encoder for so many frames a second.
    ///
    /// # Errors
    /// What OpenH264 says.
    pub fn new(fps: f64, quality: Quality) -> Result<Self, openh264::Error> {
        // The same quantiser for every block of every frame, so there is nothing that a rate control could get wrong. By the
        // standard's scale 6 more are twice the step.
        let step = match quality {
            Quality::High => 16,
            Quality::Low => 34,
        };
        let config = EncoderConfig::new()
            .profile(Profile::Baseline)
            .vui(VuiConfig::bt709())
            .usage_type(UsageType::CameraVideoRealTime)
            // Without changes of scene, this mode keeps to the range of quantisers and to nothing else.
            .rate_control_mode(RateControlMode::Bufferbased)
            .qp(QpRange::new(step, step))
            // Has to be said; the level is chosen by it.
            .bitrate(BitRate::from_bps(20_000_000))
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            // A key frame every two seconds, for players to jump to.
            .intra_frame_period(IntraFramePeriod::from_num_frames((2.0 * fps).ceil().max(1.0) as u32))
            .complexity(Complexity::Low)
            // Every frame is a frame, and rendered pictures have no noise that looking for it would find.
            .skip_frames(false)
            .scene_change_detect(false)
            .adaptive_quantization(false)
            .background_detection(false)
            // Slices for threads would be other bytes for another number of them.
            .num_threads(1);
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config)?;
        Ok(H264 { encoder, fps, encoded: 0, parameter_sets: Default::default() })
    }

    /// Encodes the next picture.
    ///
    /// # Errors
    /// What OpenH264 says.
    pub fn encode(&mut self, picture: &Yuv420) -> Result<Sample, openh264::Error> {
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
                // Units come after zeros and a one (ITU-T H.264, annex B).
                let start = 1 + unit.iter().position(|&byte| byte == 1).unwrap_or(0);
                let unit = &unit[start..];
                // The lower five bits are the type (table 7-1): 7 and 8 are parameter sets, which MP4 keeps apart.
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
        Ok(Sample { bytes, is_key })
    }
}
