//! Pixels: what rendering returns, put together, written on, and encoded as PNG and GIF.

use demosift::{Error, Result};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};

/// Rows that a line of text needs.
pub(crate) const TEXT_HEIGHT: usize = RasterHeight::Size20.val();
/// What stands between and around pictures.
const PAPER: u8 = 255;
/// How hard the encoder of clips looks for 256 fitting colors, from 1 to 30: 10 is its makers' advice for good speed.
const COLOR_SEARCH: i32 = 10;

/// A picture, 8 bits a color.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green, blue of each pixel, row after row from the top; `[height · width · 3]`.
    pub rgb: Vec<u8>,
}

impl Picture {
    /// White paper.
    pub(crate) fn blank(width: usize, height: usize) -> Self {
        Self { width, height, rgb: vec![PAPER; width * height * 3] }
    }

    /// Lays another picture on this one, its upper left corner at this column and row; what hangs over is cut off.
    pub(crate) fn paste(&mut self, other: &Self, left: usize, top: usize) {
        let columns = other.width.min(self.width.saturating_sub(left));
        if columns == 0 {
            return;
        }
        for row in 0..other.height.min(self.height.saturating_sub(top)) {
            let from = row * other.width * 3;
            let to = ((top + row) * self.width + left) * 3;
            self.rgb[to..to + columns * 3].copy_from_slice(&other.rgb[from..from + columns * 3]);
        }
    }

    /// Writes black text of Latin letters; what hangs over is cut off.
    pub(crate) fn write(&mut self, text: &str, left: usize, top: usize) {
        for (place, character) in text.chars().enumerate() {
            let glyph = [character, '?']
                .into_iter()
                .find_map(|character| get_raster(character, FontWeight::Regular, RasterHeight::Size20));
            let Some(glyph) = glyph else { continue };
            let mut drawn = Self::blank(glyph.width(), glyph.height());
            let ink = glyph.rows().flatten();
            drawn.rgb.chunks_exact_mut(3).zip(ink).for_each(|(pixel, ink)| pixel.fill(PAPER - ink));
            self.paste(&drawn, left + place * glyph.width(), top);
        }
    }

    /// Pictures of one size side by side.
    pub fn strip(pictures: &[Self]) -> Self {
        let width = pictures.iter().map(|picture| picture.width).sum();
        let mut strip = Self::blank(width, pictures.first().map_or(0, |picture| picture.height));
        let mut left = 0;
        for picture in pictures {
            strip.paste(picture, left, 0);
            left += picture.width;
        }
        strip
    }

    /// The bytes of a PNG file of at most 256 colors, which takes about a third of one of all colors.
    ///
    /// # Errors
    /// If the picture is empty, has not 3 bytes a pixel, or more than 65535 columns or rows.
    pub fn to_small_png(&self) -> Result<Vec<u8>> {
        let failed = |error: png::EncodingError| self.cannot("PNG", &error);
        let sides = [self.width, self.height].map(u16::try_from);
        let ([Ok(width), Ok(height)], true) = (sides, self.rgb.len() == self.width * self.height * 3) else {
            return Err(self.cannot("PNG", &"at most 65535 x 65535 of 3 bytes can"));
        };
        let frame = gif::Frame::from_rgb_speed(width, height, &self.rgb, COLOR_SEARCH);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width.into(), height.into());
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_palette(frame.palette.unwrap_or_default());
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(&frame.buffer).and_then(|()| writer.finish()).map_err(failed)?;
        Ok(bytes)
    }

    /// The bytes of a PNG file.
    ///
    /// # Errors
    /// If the picture is empty, or has not 3 bytes a pixel.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let failed = |error: png::EncodingError| self.cannot("PNG", &error);
        let [width, height] = [self.width, self.height].map(|size| u32::try_from(size).unwrap_or(0));
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header().map_err(failed)?;
        writer.write_image_data(&self.rgb).and_then(|()| writer.finish()).map_err(failed)?;
        Ok(bytes)
    }

    fn cannot(&self, format: &str, error: &dyn std::fmt::Display) -> Error {
        Error::bad_input(format!(
            "a picture of {} x {} pixels cannot be written as {format}: {error}",
            self.width, self.height
        ))
    }
}

/// Columns that a line of text needs.
pub(crate) fn text_width(text: &str) -> usize {
    text.chars().count() * get_raster_width(FontWeight::Regular, RasterHeight::Size20)
}

/// An animated GIF, which plays forever.
pub(crate) struct Animation {
    encoder: Option<gif::Encoder<Vec<u8>>>,
    /// Hundredths of a second that all pictures so far are shown, as asked for and as written.
    asked: f64,
    written: u64,
}

impl Animation {
    pub(crate) fn new() -> Self {
        Self { encoder: None, asked: 0.0, written: 0 }
    }

    /// Appends a picture, which is shown for some seconds; all must be of one size.
    ///
    /// The format counts hundredths of a second, so what is rounded off is made good by the next picture.
    pub(crate) fn show(&mut self, picture: &Picture, secs: f64) -> Result<()> {
        let failed = |error: gif::EncodingError| picture.cannot("GIF", &error);
        let [width, height] = [picture.width, picture.height].map(u16::try_from);
        let (Ok(width), Ok(height)) = (width, height) else {
            return Err(picture.cannot("GIF", &"at most 65535 x 65535 can"));
        };
        let encoder = match &mut self.encoder {
            Some(encoder) => encoder,
            none => {
                let mut encoder = gif::Encoder::new(Vec::new(), width, height, &[]).map_err(failed)?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
                none.insert(encoder)
            }
        };
        self.asked += 100.0 * secs;
        let delay = (self.asked.round() as u64).saturating_sub(self.written);
        self.written += delay;
        let mut frame = gif::Frame::from_rgb_speed(width, height, &picture.rgb, COLOR_SEARCH);
        frame.delay = u16::try_from(delay).unwrap_or(u16::MAX);
        encoder.write_frame(&frame).map_err(failed)
    }

    /// The bytes of the file; `None` if nothing was shown.
    pub(crate) fn into_bytes(self) -> Result<Option<Vec<u8>>> {
        let bytes = self.encoder.map(gif::Encoder::into_inner).transpose();
        bytes.map_err(|error| Error::bad_input(format!("the GIF cannot be written: {error}")))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn gray(width: usize, height: usize, level: u8) -> Picture {
        Picture { width, height, rgb: vec![level; width * height * 3] }
    }

    #[test]
    fn a_png_holds_every_pixel() {
        let mut picture = gray(5, 3, 90);
        picture.rgb[3 * 7] = 200;
        let mut reader =
            png::Decoder::new(std::io::Cursor::new(picture.to_png().unwrap())).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut rgb).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (5, 3, png::ColorType::Rgb));
        assert_eq!(rgb, picture.rgb);
        assert!(gray(0, 3, 1).to_png().unwrap_err().is_bad_input());
    }

    #[test]
    fn an_animation_keeps_time_though_its_format_counts_in_hundredths() {
        let mut animation = Animation::new();
        for number in 0..8 {
            animation.show(&gray(6, 4, 30 * number), 0.0125).unwrap();
        }
        let bytes = animation.into_bytes().unwrap().unwrap();
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(&bytes[..]).unwrap();
        let mut delays = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            assert_eq!((frame.width, frame.height), (6, 4));
            assert!(frame.buffer[0].abs_diff(30 * delays.len() as u8) < 3, "{}", frame.buffer[0]);
            delays.push(frame.delay);
        }
        assert_eq!((delays.len(), delays.iter().sum::<u16>()), (8, 10), "{delays:?}");
        assert!(Animation::new().into_bytes().unwrap().is_none());
    }

    #[test]
    fn what_is_pasted_or_written_beyond_the_edge_is_cut_off() {
        let mut paper = Picture::blank(30, 20);
        paper.paste(&gray(4, 4, 0), 28, 18);
        let black = |picture: &Picture| picture.rgb.iter().filter(|value| **value == 0).count();
        assert_eq!(black(&paper), 2 * 2 * 3);
        paper.paste(&gray(4, 4, 0), 99, 99);
        assert_eq!(black(&paper), 2 * 2 * 3);
        let mut paper = Picture::blank(30, TEXT_HEIGHT);
        paper.write("a long word", 0, 0);
        assert!(paper.rgb.iter().any(|value| *value < 60), "there is ink");
        // The arrow has no glyph.
        let (mut arrow, mut mark) = (Picture::blank(30, 20), Picture::blank(30, 20));
        arrow.write("\u{2192}", 0, 0);
        mark.write("?", 0, 0);
        assert_eq!(arrow, mark);
    }
}
