/// Planes of one size, one after another, each row by row from the top left.
///
/// It owns its memory, to be reused: [`Stack::shape`].
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Stack {
    width: usize,
    height: usize,
    numbers: Vec<f32>,
}

impl Stack {
    /// Makes it `planes` of this size in the memory that it has; what it holds then is anything.
    pub fn shape(&mut self, planes: usize, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.numbers.resize(planes * width * height, 0.0);
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of one plane.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All numbers, plane after plane.
    pub fn numbers(&self) -> &[f32] {
        &self.numbers
    }

    /// All numbers, to be written.
    pub fn numbers_mut(&mut self) -> &mut [f32] {
        &mut self.numbers
    }

    /// One plane.
    ///
    /// # Panics
    /// Where there is no such plane.
    pub fn plane(&self, plane: usize) -> &[f32] {
        let size = self.width * self.height;
        &self.numbers[plane * size..][..size]
    }

    /// One plane, to be written.
    ///
    /// # Panics
    /// Where there is no such plane.
    pub fn plane_mut(&mut self, plane: usize) -> &mut [f32] {
        let size = self.width * self.height;
        &mut self.numbers[plane * size..][..size]
    }

    /// One row of one plane.
    ///
    /// # Panics
    /// Where there is no such row.
    pub fn row(&self, plane: usize, row: usize) -> &[f32] {
        &self.numbers[(plane * self.height + row) * self.width..][..self.width]
    }

    /// One row of one plane, to be written.
    ///
    /// # Panics
    /// Where there is no such row.
    pub fn row_mut(&mut self, plane: usize, row: usize) -> &mut [f32] {
        &mut self.numbers[(plane * self.height + row) * self.width..][..self.width]
    }

    /// How many planes there are.
    pub fn planes(&self) -> usize {
        self.numbers.len().checked_div(self.width * self.height).unwrap_or(0)
    }
}
