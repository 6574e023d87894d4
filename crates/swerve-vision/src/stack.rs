/// Planes of equal size, one after another, each row by row from the top left.
///
/// Owns its memory, which [`Stack::shape`] reuses.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Stack {
    width: usize,
    height: usize,
    numbers: Vec<f32>,
}

impl Stack {
    /// Resizes to `planes` of this size, reusing the memory; the values are unspecified.
    pub fn shape(&mut self, planes: usize, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.numbers.resize(planes * width * height, 0.0);
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of one plane.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, plane by plane.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// All values, mutable.
    pub fn numbers_mut(&mut self) -> &mut [f32] {
        &mut self.numbers
    }

    /// Values of one plane.
    ///
    /// # Panics
    /// If the plane is out of range.
    pub fn plane(&self, plane: usize) -> &[f32] {
        let size = self.width * self.height;
        &self.numbers[plane * size..][..size]
    }

    /// Values of one plane, mutable.
    ///
    /// # Panics
    /// If the plane is out of range.
    pub fn plane_mut(&mut self, plane: usize) -> &mut [f32] {
        let size = self.width * self.height;
        &mut self.numbers[plane * size..][..size]
    }

    /// Values of one row of a plane.
    ///
    /// # Panics
    /// If the row is out of range.
    pub fn row(&self, plane: usize, row: usize) -> &[f32] {
        &self.numbers[(plane * self.height + row) * self.width..][..self.width]
    }

    /// Values of one row of a plane, mutable.
    ///
    /// # Panics
    /// If the row is out of range.
    pub fn row_mut(&mut self, plane: usize, row: usize) -> &mut [f32] {
        &mut self.numbers[(plane * self.height + row) * self.width..][..self.width]
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        self.numbers.len().checked_div(self.width * self.height).unwrap_or(0)
    }
}
