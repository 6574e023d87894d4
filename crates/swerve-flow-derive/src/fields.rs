//! The fields of a struct, as both derives read them.

use syn::ext::IdentExt;
use syn::{Attribute, Data, DeriveInput, Error, Expr, ExprLit, Fields, Ident, Lit, Meta, Type};

/// A struct field that declares a port.
pub(crate) struct Field<'a> {
    pub(crate) ident: &'a Ident,
    pub(crate) ty: &'a Type,
    /// Name of the port.
    pub(crate) name: String,
    /// Doc comment, its lines joined.
    pub(crate) doc: String,
    pub(crate) feedback: bool,
    pub(crate) raw: bool,
}

/// Returns the named fields of a struct; an error for anything else.
pub(crate) fn fields(input: &DeriveInput) -> Result<Vec<Field<'_>>, Error> {
    let Data::Struct(data) = &input.data else {
        return Err(Error::new_spanned(&input.ident, "ports are the fields of a struct"));
    };
    let Fields::Named(fields) = &data.fields else {
        return Err(Error::new_spanned(&input.ident, "ports are named: give the struct named fields"));
    };
    fields.named.iter().filter_map(|field| Some((field.ident.as_ref()?, field))).map(field).collect()
}

fn field<'a>((ident, field): (&'a Ident, &'a syn::Field)) -> Result<Field<'a>, Error> {
    let (name, doc) = (ident.unraw().to_string(), doc(&field.attrs));
    Field { ident, ty: &field.ty, name, doc, feedback: false, raw: false }.with_attributes(&field.attrs)
}

impl Field<'_> {
    fn with_attributes(mut self, attributes: &[Attribute]) -> Result<Self, Error> {
        for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("port")) {
            attribute.parse_nested_meta(|meta| {
                let flag = match &meta.path {
                    path if path.is_ident("feedback") => &mut self.feedback,
                    path if path.is_ident("raw") => &mut self.raw,
                    _ => return Err(meta.error("expected `feedback` or `raw`")),
                };
                *flag = true;
                Ok(())
            })?;
        }
        Ok(self)
    }
}

fn doc(attributes: &[Attribute]) -> String {
    let lines = attributes.iter().filter_map(|attribute| match &attribute.meta {
        Meta::NameValue(meta) if meta.path.is_ident("doc") => match &meta.value {
            Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Some(text.value().trim().to_owned()),
            _ => None,
        },
        _ => None,
    });
    lines.filter(|line| !line.is_empty()).collect::<Vec<_>>().join(" ")
}
