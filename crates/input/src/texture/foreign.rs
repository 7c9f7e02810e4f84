//! Formats of pictures and drawings that are not read, by how their files begin or what they are called.

use std::path::Path;

use terrace_core::diag::Diag;

/// What a format is called, and what to do with a file of it.
type Format = (&'static str, &'static str);

const AS_PNG: &str = "save it as PNG in an image editor";
const AS_SVG: &str = "save it as plain SVG or DXF in the drawing program";

/// Formats by their first bytes.
const BY_START: [(&[u8], Format); 16] = [
    (b"GIF8", ("a GIF image", AS_PNG)),
    (b"\x00\x00\x00\x0cjP  ", ("a JPEG 2000 image", AS_PNG)),
    (b"\xff\x4f\xff\x51", ("a JPEG 2000 image", AS_PNG)),
    (b"\x00\x00\x00\x0cJXL ", ("a JPEG XL image", AS_PNG)),
    (b"\xff\x0a", ("a JPEG XL image", AS_PNG)),
    (b"8BPS", ("a Photoshop image (PSD)", AS_PNG)),
    (b"gimp xcf", ("a GIMP image (XCF)", AS_PNG)),
    (b"\x00\x00\x01\x00", ("an icon (ICO)", AS_PNG)),
    (b"qoif", ("a QOI image", AS_PNG)),
    (b"\xc5\xd0\xd3\xc6", ("a PostScript file (EPS)", AS_SVG)),
    (b"\xd7\xcd\xc6\x9a", ("a Windows metafile (WMF)", AS_SVG)),
    (b"\x01\x00\x09\x00\x00\x03", ("a Windows metafile (WMF)", AS_SVG)),
    (b"\x02\x00\x09\x00\x00\x03", ("a Windows metafile (WMF)", AS_SVG)),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", ("a document of Office, Visio or the like", AS_SVG)),
    (b"PK\x03\x04", ("a ZIP archive, as CorelDRAW and LibreOffice save drawings", AS_SVG)),
    (b"7z\xbc\xaf\x27\x1c", ("a 7z archive", "unpack it")),
];

/// Brands of the ISO base media file format.
const BRANDS: [(&[u8], Format); 7] = [
    (b"heic", ("an HEIC image", AS_PNG)),
    (b"heix", ("an HEIC image", AS_PNG)),
    (b"hevc", ("an HEIC image", AS_PNG)),
    (b"mif1", ("an HEIF image", AS_PNG)),
    (b"msf1", ("an HEIF image", AS_PNG)),
    (b"avif", ("an AVIF image", AS_PNG)),
    (b"avis", ("an AVIF image", AS_PNG)),
];

/// Forms of RIFF; those of CorelDRAW end with their version.
const FORMS: [(&[u8], Format); 2] =
    [(b"WEBP", ("a WebP image", AS_PNG)), (b"CDR", ("a CorelDRAW drawing (CDR)", AS_SVG))];

/// Formats that files may be taken for SVG in spite of: how they begin, the extensions of their names, what they are,
/// what to do.
const TEXTS: [(&[u8], &[&str], &str, &str); 4] = [
    (b"%PDF", &["pdf"], "a PDF document", AS_PLAIN),
    (b"%!PS", &["ps", "eps", "ai"], "a PostScript drawing", AS_PLAIN),
    (b"AutoCAD Binary DXF", &[], "a DXF drawing", "give its name the extension .dxf"),
    (b"AC10", &["dwg"], "a DWG drawing", AS_PLAIN),
];

const AS_PLAIN: &str = "open it in Inkscape and save it as plain SVG, with the page's size in mm";

/// What is said of a file that its name shows to be no SVG drawing.
pub(super) fn name(path: &Path) -> Option<Diag> {
    let is = |extension: &&str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
    TEXTS.iter().find(|(_, extensions, ..)| extensions.iter().any(is)).map(|row| unread(row.2, row.3))
}

/// What is said of a file that begins as those of other programs do; SVG begins with a `<`, after a byte order mark
/// and blanks.
pub(super) fn text(bytes: &[u8]) -> Option<Diag> {
    TEXTS.iter().find(|(begin, ..)| bytes.starts_with(begin)).map(|row| unread(row.2, row.3))
}

fn unread(what: &str, hint: &str) -> Diag {
    let text = format!("this is {what}, which is not read yet: textures are SVG, DXF and HPGL drawings and bitmaps");
    Diag::input("svg-format", text).hint(hint)
}

/// What is said of a file of a format that is known and not read.
pub(super) fn refused(bytes: &[u8]) -> Option<Diag> {
    let (what, hint) = format(bytes)?;
    let text = format!("this is {what}, which is not read");
    Some(Diag::input("drawing-format", text).hint(hint))
}

fn format(bytes: &[u8]) -> Option<Format> {
    let find = |table: &[(&[u8], Format)], at: usize| {
        let rest = bytes.get(at..)?;
        table.iter().find(|(begin, _)| rest.starts_with(begin)).map(|row| row.1)
    };
    if bytes.starts_with(b"RIFF") {
        return find(&FORMS, 8);
    }
    if bytes.get(4..8) == Some(b"ftyp") {
        return find(&BRANDS, 8);
    }
    if bytes.starts_with(b"\x01\x00\x00\x00") && bytes.get(40..44) == Some(b" EMF") {
        return Some(("an enhanced metafile (EMF)", AS_SVG));
    }
    find(&BY_START, 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_how_they_begin() {
        let emf = [&b"\x01\0\0\0"[..], &[0; 36], b" EMF"].concat();
        for (bytes, say) in [
            (&b"GIF89a"[..], "a GIF"),
            (b"RIFF\x10\0\0\0WEBPVP8 ", "a WebP"),
            (b"RIFF\x10\0\0\0CDRC", "a CorelDRAW"),
            (b"\0\0\0\x18ftypheic", "an HEIC"),
            (b"\0\0\0\x20ftypavif", "an AVIF"),
            (b"\0\0\0\x0cjP  \r\n", "a JPEG 2000"),
            (b"8BPS\0\x01", "a Photoshop"),
            (&emf, "an enhanced metafile"),
            (b"\xd7\xcd\xc6\x9a\0\0", "a Windows metafile"),
            (b"PK\x03\x04\x14", "a ZIP"),
        ] {
            let d = refused(bytes).unwrap_or_else(|| panic!("{say} is not known"));
            assert!(d.message.contains(say) && !d.hint.is_empty(), "{d}");
        }
        let read: [&[u8]; 12] = [
            b"<svg/>",
            b"  0\nSECTION",
            b"AutoCAD Binary DXF\r\n",
            b"IN;SP1;",
            b"PU0,0;PD40,0",
            b"\x1f\x8b\x08",
            b"\x89PNG",
            b"\xff\xd8\xff",
            b"BM",
            b"II*\0",
            b"RIFF",
            b"",
        ];
        for bytes in read {
            assert!(refused(bytes).is_none(), "{bytes:?}");
        }
    }
}
