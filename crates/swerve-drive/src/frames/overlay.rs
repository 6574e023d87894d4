//! Overlay of pixel classes over an image, with a legend.

use core::convert::Infallible;

use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::FONT_7X13_BOLD;
use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use embedded_graphics::prelude::{
    DrawTarget, Drawable as _, OriginDimensions, Pixel, Point, Primitive as _, Size,
};
use embedded_graphics::primitives::{PrimitiveStyle, Rectangle};
use embedded_graphics::text::Text;

use super::colours::class;

/// Weight of the class colour in a pixel, as a fraction; the rest is the image.
const SHARE: [u16; 2] = [3, 5];
/// Height of a legend line, pixels.
const LINE_PX: u32 = 17;

/// Tints an RGB image by the classes of its pixels (Cityscapes ids), in the class colours, and draws a legend with the
/// given names and ids in the upper left corner.
pub fn overlay(rgb: &mut [u8], [width, height]: [usize; 2], classes: &[u8], names: &[(&str, u8)]) {
    for (pixel, id) in rgb.chunks_exact_mut(3).zip(classes) {
        for (own, colour) in pixel.iter_mut().zip(class(*id)) {
            *own =
                ((u16::from(*own) * SHARE[1] + u16::from(colour) * SHARE[0]) / (SHARE[0] + SHARE[1])) as u8;
        }
    }
    let mut sheet = Sheet { rgb, size: Size::new(width as u32, height as u32) };
    let longest = names.iter().map(|(name, _)| name.len() as u32).max().unwrap_or(0);
    let ground = Rectangle::new(Point::zero(), Size::new(7 * longest + 30, LINE_PX * names.len() as u32 + 6));
    let Ok(()) = ground.into_styled(PrimitiveStyle::with_fill(Rgb888::BLACK)).draw(&mut sheet);
    for (k, (name, id)) in names.iter().enumerate() {
        let top = 4 + (LINE_PX as usize * k) as i32;
        let [r, g, b] = class(*id);
        let swatch = Rectangle::new(Point::new(4, top), Size::new(14, LINE_PX - 4));
        let Ok(()) = swatch.into_styled(PrimitiveStyle::with_fill(Rgb888::new(r, g, b))).draw(&mut sheet);
        let style = MonoTextStyle::new(&FONT_7X13_BOLD, Rgb888::WHITE);
        let Ok(_) = Text::new(name, Point::new(23, top + 11), style).draw(&mut sheet);
    }
}

/// An image to draw on.
pub(super) struct Sheet<'a> {
    pub(super) rgb: &'a mut [u8],
    pub(super) size: Size,
}

impl OriginDimensions for Sheet<'_> {
    fn size(&self) -> Size {
        self.size
    }
}

impl DrawTarget for Sheet<'_> {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        let (width, height) = (self.size.width as i32, self.size.height as i32);
        for Pixel(at, colour) in pixels {
            if (0..width).contains(&at.x) && (0..height).contains(&at.y) {
                let start = 3 * (at.y * width + at.x) as usize;
                self.rgb[start..start + 3].copy_from_slice(&[colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}
