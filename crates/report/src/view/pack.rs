//! Numbers as the page reads them: planes of bytes, differences, deflate, base64.

use std::io::Write;

use base64::Engine;
use flate2::Compression;
use flate2::write::DeflateEncoder;

/// A data element of the page.
#[derive(Debug, Default)]
pub(super) struct Data(Vec<u8>);

/// Half of the data of a part is what this takes off it; more would cost several times as long.
const LEVEL: Compression = Compression::new(3);

impl Data {
    pub(super) fn u8(&mut self, values: impl IntoIterator<Item = u8>) {
        self.0.extend(values);
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    /// Low bytes, then high bytes.
    pub(super) fn u16_planes(&mut self, values: impl Iterator<Item = u16> + Clone) {
        for k in 0..2 {
            self.0.extend(values.clone().map(|v| v.to_le_bytes()[k]));
        }
    }

    /// Each as the difference to the one before.
    pub(super) fn u16_delta(&mut self, values: impl Iterator<Item = u16> + Clone) {
        let mut last = 0u16;
        let differences: Vec<u16> = values.map(|v| v.wrapping_sub(std::mem::replace(&mut last, v))).collect();
        self.u16_planes(differences.into_iter());
    }

    /// Four planes.
    pub(super) fn u32_planes(&mut self, values: impl Iterator<Item = u32> + Clone) {
        for k in 0..4 {
            self.0.extend(values.clone().map(|v| v.to_le_bytes()[k]));
        }
    }

    /// Each as the difference to the one before.
    pub(super) fn u32_delta(&mut self, values: impl Iterator<Item = u32>) {
        let mut last = 0u32;
        let differences: Vec<u32> = values.map(|v| v.wrapping_sub(std::mem::replace(&mut last, v))).collect();
        self.u32_planes(differences.into_iter());
    }

    pub(super) fn f32(&mut self, values: impl IntoIterator<Item = f32>) {
        self.0.extend(values.into_iter().flat_map(f32::to_le_bytes));
    }

    pub(super) fn text(text: &str) -> Self {
        Self(text.as_bytes().to_vec())
    }

    /// The element of the page: raw deflate in base64.
    pub(super) fn element(&self, name: &str) -> String {
        let mut deflate = DeflateEncoder::new(Vec::with_capacity(self.0.len() / 2), LEVEL);
        deflate.write_all(&self.0).expect("a Vec takes every byte");
        let bytes = deflate.finish().expect("a Vec takes every byte");
        let mut out = format!("<script id=\"data-{name}\" type=\"application/octet-stream\">");
        base64::engine::general_purpose::STANDARD.encode_string(bytes, &mut out);
        out + "</script>\n"
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    #[test]
    fn an_element_holds_planes_of_differences_that_can_be_undone() {
        let values = [5u16, 3, 65_535, 0, 40_000];
        let mut data = Data::default();
        data.u16_delta(values.into_iter());
        data.u32_delta([7, 2, u32::MAX].into_iter());
        let text = data.element("x");
        let inner = text.split(['<', '>']).nth(2).expect("between the tags");
        let bytes = base64::engine::general_purpose::STANDARD.decode(inner).expect("base64");
        let mut plain = Vec::new();
        flate2::read::DeflateDecoder::new(&bytes[..]).read_to_end(&mut plain).expect("deflate");
        let mut last = 0u16;
        let read: Vec<u16> = (0..5)
            .map(|i| {
                last = last.wrapping_add(u16::from_le_bytes([plain[i], plain[5 + i]]));
                last
            })
            .collect();
        assert_eq!(read, values);
        let words: Vec<u32> = (0..3).map(|i| u32::from_le_bytes([10, 13, 16, 19].map(|p| plain[p + i]))).collect();
        assert_eq!(words, [7, 2u32.wrapping_sub(7), u32::MAX - 2]);
    }
}
