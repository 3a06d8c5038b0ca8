//! A figure as PDF: one page, its shapes as shapes, its text as outlines, so that no reader needs a font.

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish as _, Pdf, Rect, Ref, TextStr};
use resvg::tiny_skia::{Path, PathSegment, Point, Transform};
use resvg::usvg::{
    ClipPath, Fill, FillRule, Group, LineCap, LineJoin, Node, Opacity, Paint, Stroke, Tree,
};

/// Points of PostScript (1/72 inch) in a pixel of SVG (1/96 inch).
const POINTS: f32 = 0.75;

/// How hard the page is compressed, of 10.
const LEVEL: u8 = 6;

/// The page of `tree`; `Err` names what it has that no figure of ours does, such as an image.
pub(super) fn pdf(tree: &Tree) -> Result<Vec<u8>, &'static str> {
    let (width, height) = (POINTS * tree.size().width(), POINTS * tree.size().height());
    let mut page = Page {
        content: Content::new(),
        // A page has y up.
        place: Transform::from_row(POINTS, 0.0, 0.0, -POINTS, 0.0, height),
    };
    page.group(tree.root())?;
    let content = compress_to_vec_zlib(&page.content.finish(), LEVEL);

    let [catalog, pages, sheet, stream, information] = [1, 2, 3, 4, 5].map(Ref::new);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([sheet]).count(1);
    let mut only = pdf.page(sheet);
    only.media_box(Rect::new(0.0, 0.0, width, height));
    only.parent(pages).contents(stream);
    only.resources();
    only.finish();
    pdf.stream(stream, &content).filter(Filter::FlateDecode);
    let producer = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));
    pdf.document_info(information).producer(TextStr(producer));
    Ok(pdf.finish())
}

/// What is drawn on the page, and where a point of the figure lies on it.
struct Page {
    content: Content,
    place: Transform,
}

impl Page {
    fn group(&mut self, group: &Group) -> Result<(), &'static str> {
        if group.mask().is_some() || !group.filters().is_empty() {
            return Err("a mask or a filter");
        }
        opaque(group.opacity())?;
        self.content.save_state();
        if let Some(clip) = group.clip_path() {
            self.clip(clip, group.abs_transform());
        }
        for node in group.children() {
            match node {
                Node::Group(inner) => self.group(inner)?,
                Node::Text(text) => self.group(text.flattened())?,
                Node::Image(_) => return Err("an image"),
                Node::Path(path) if path.is_visible() => {
                    let place = path.abs_transform().post_concat(self.place);
                    self.path(path.data(), place, path.fill(), path.stroke())?;
                }
                Node::Path(_) => {}
            }
        }
        self.content.restore_state();
        Ok(())
    }

    /// What follows is seen within the shapes of `clip` only, which belongs to a group that lies at `group`.
    fn clip(&mut self, clip: &ClipPath, group: Transform) {
        for node in clip.root().children() {
            if let Node::Path(path) = node {
                let place = path.abs_transform().post_concat(clip.transform());
                self.outline(
                    path.data(),
                    place.post_concat(group).post_concat(self.place),
                );
            }
        }
        self.content.clip_nonzero().end_path();
    }

    fn path(
        &mut self,
        path: &Path,
        place: Transform,
        fill: Option<&Fill>,
        stroke: Option<&Stroke>,
    ) -> Result<(), &'static str> {
        if let Some(fill) = fill {
            let [r, g, b] = color(fill.paint(), fill.opacity())?;
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some(stroke) = stroke {
            self.pen(stroke, place)?;
        }
        if fill.is_none() && stroke.is_none() {
            return Ok(());
        }
        self.outline(path, place);
        let even_odd = fill.is_some_and(|fill| fill.rule() == FillRule::EvenOdd);
        match (fill.is_some(), stroke.is_some()) {
            (true, true) if even_odd => self.content.fill_even_odd_and_stroke(),
            (true, true) => self.content.fill_nonzero_and_stroke(),
            (true, false) if even_odd => self.content.fill_even_odd(),
            (true, false) => self.content.fill_nonzero(),
            (false, _) => self.content.stroke(),
        };
        Ok(())
    }

    /// The pen of a stroke; lengths are those of a figure that is scaled alike in both directions.
    fn pen(&mut self, stroke: &Stroke, place: Transform) -> Result<(), &'static str> {
        let [r, g, b] = color(stroke.paint(), stroke.opacity())?;
        let scale = (place.sx * place.sy - place.kx * place.ky).abs().sqrt();
        let dashes = stroke.dasharray().unwrap_or_default();
        self.content
            .set_stroke_rgb(r, g, b)
            .set_line_width(scale * stroke.width().get())
            .set_line_cap(match stroke.linecap() {
                LineCap::Butt => LineCapStyle::ButtCap,
                LineCap::Round => LineCapStyle::RoundCap,
                LineCap::Square => LineCapStyle::ProjectingSquareCap,
            })
            .set_line_join(match stroke.linejoin() {
                LineJoin::Round => LineJoinStyle::RoundJoin,
                LineJoin::Bevel => LineJoinStyle::BevelJoin,
                LineJoin::Miter | LineJoin::MiterClip => LineJoinStyle::MiterJoin,
            })
            .set_dash_pattern(
                dashes.iter().map(|dash| scale * dash),
                scale * stroke.dashoffset(),
            );
        Ok(())
    }

    fn outline(&mut self, path: &Path, place: Transform) {
        let at = |mut point: Point| {
            place.map_point(&mut point);
            point
        };
        let mut last = Point::zero();
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(p) => {
                    last = p;
                    self.content.move_to(at(p).x, at(p).y);
                }
                PathSegment::LineTo(p) => {
                    last = p;
                    self.content.line_to(at(p).x, at(p).y);
                }
                PathSegment::QuadTo(c, p) => {
                    // The same curve as a cubic one.
                    let toward = |end: Point| {
                        at(Point::from_xy(
                            end.x + 2.0 / 3.0 * (c.x - end.x),
                            end.y + 2.0 / 3.0 * (c.y - end.y),
                        ))
                    };
                    let (a, b, end) = (toward(last), toward(p), at(p));
                    last = p;
                    self.content.cubic_to(a.x, a.y, b.x, b.y, end.x, end.y);
                }
                PathSegment::CubicTo(c, d, p) => {
                    let (a, b, end) = (at(c), at(d), at(p));
                    last = p;
                    self.content.cubic_to(a.x, a.y, b.x, b.y, end.x, end.y);
                }
                PathSegment::Close => {
                    self.content.close_path();
                }
            }
        }
    }
}

/// Red, green and blue, 0 to 1.
fn color(paint: &Paint, opacity: Opacity) -> Result<[f32; 3], &'static str> {
    opaque(opacity)?;
    match paint {
        Paint::Color(c) => Ok([c.red, c.green, c.blue].map(|part| f32::from(part) / 255.0)),
        _ => Err("a gradient or a pattern"),
    }
}

fn opaque(opacity: Opacity) -> Result<(), &'static str> {
    if opacity.get() < 1.0 {
        return Err("something that can be seen through");
    }
    Ok(())
}
