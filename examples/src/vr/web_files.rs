//! The page, built from `examples/web` and part of the program.

use super::page_kind::PageKind;

/// A file of the page.
pub(super) struct WebFile {
    pub(super) kind: &'static str,
    pub(super) bytes: &'static [u8],
}

/// The file of a path.
pub(super) fn web_file(path: &str, page: PageKind) -> Option<WebFile> {
    let (kind, bytes): (&str, &[u8]) = match path {
        "/" if page == PageKind::Design => ("text/html; charset=utf-8", include_bytes!("../../web/dist/design.html")),
        "/design.js" => ("text/javascript; charset=utf-8", include_bytes!("../../web/dist/design.js")),
        "/design.css" => ("text/css; charset=utf-8", include_bytes!("../../web/dist/design.css")),
        "/shared.js" => ("text/javascript; charset=utf-8", include_bytes!("../../web/dist/shared.js")),
        "/" => ("text/html; charset=utf-8", include_bytes!("../../web/dist/index.html")),
        "/app.js" => ("text/javascript; charset=utf-8", include_bytes!("../../web/dist/app.js")),
        "/style.css" => ("text/css; charset=utf-8", include_bytes!("../../web/dist/style.css")),
        "/licences.txt" => ("text/plain; charset=utf-8", include_bytes!("../../web/dist/licences.txt")),
        _ => return None,
    };
    Some(WebFile { kind, bytes })
}
