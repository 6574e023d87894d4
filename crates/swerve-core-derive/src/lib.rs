//! `#[derive(Ranges)]`: the run-time check of the ranges written at the fields of a struct.
//!
//! Exported by `swerve-core`, whose documentation describes the check.

use proc_macro2::TokenStream;
use quote::quote;
use syn::ext::IdentExt;
use syn::meta::ParseNestedMeta;
use syn::{Data, DeriveInput, Error, Expr, Field, Fields, parse_macro_input, token};

/// Checks each field that has a range: `#[schemars(range(min = 0.1, max = 30.0))]`, which is also that of the JSON
/// schema, or `#[schemars(inner(range(...)))]` for the entries of an array. `#[ranges(nested)]` marks a field whose type
/// has ranges itself, `#[ranges(flatten)]` one whose keys are those of the struct around it.
#[proc_macro_derive(Ranges, attributes(schemars, ranges))]
pub fn derive_ranges(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    derive(&input).unwrap_or_else(Error::into_compile_error).into()
}

fn derive(input: &DeriveInput) -> Result<TokenStream, Error> {
    let Data::Struct(syn::DataStruct { fields: Fields::Named(fields), .. }) = &input.data else {
        return Err(Error::new_spanned(&input.ident, "ranges are those of named fields"));
    };
    let checks = fields.named.iter().map(check).collect::<Result<Vec<_>, _>>()?;
    let (name, (generics, of, bounds)) = (&input.ident, input.generics.split_for_impl());
    Ok(quote! {
        impl #generics ::swerve_core::param::Ranges for #name #of #bounds {
            fn check_each(
                &self,
                report: ::swerve_core::param::Report<'_>,
            ) -> ::core::result::Result<(), ::swerve_core::param::ParamError> {
                #(#checks)*
                ::core::result::Result::Ok(())
            }
        }
    })
}

/// Check of a field; empty without a range.
fn check(field: &Field) -> Result<TokenStream, Error> {
    let Some(ident) = &field.ident else { return Ok(TokenStream::new()) };
    let key = ident.unraw().to_string();
    let found = Found::of(field)?;
    Ok(match found {
        Found { nested: true, .. } => quote! {
            ::swerve_core::param::Ranges::check_each(&self.#ident, &mut |error| report(error.under(#key)))?;
        },
        Found { flatten: true, .. } => quote! {
            ::swerve_core::param::Ranges::check_each(&self.#ident, report)?;
        },
        Found { min: Some(min), max: Some(max), .. } => quote! {
            ::swerve_core::param::Numbers::check_within(
                &self.#ident,
                #key,
                [f64::from(#min), f64::from(#max)],
                report,
            )?;
        },
        Found { min: None, max: None, .. } => TokenStream::new(),
        _ => return Err(Error::new_spanned(ident, "a range has `min` and `max`")),
    })
}

/// Attributes of a field.
#[derive(Default)]
struct Found {
    min: Option<Expr>,
    max: Option<Expr>,
    nested: bool,
    flatten: bool,
}

impl Found {
    fn of(field: &Field) -> Result<Self, Error> {
        let mut found = Self::default();
        for attribute in &field.attrs {
            if attribute.path().is_ident("schemars") {
                attribute.parse_nested_meta(|meta| found.read(&meta))?;
            } else if attribute.path().is_ident("ranges") {
                attribute.parse_nested_meta(|meta| {
                    let flag = match &meta.path {
                        path if path.is_ident("nested") => &mut found.nested,
                        path if path.is_ident("flatten") => &mut found.flatten,
                        _ => return Err(meta.error("expected `nested` or `flatten`")),
                    };
                    *flag = true;
                    Ok(())
                })?;
            }
        }
        Ok(found)
    }

    /// Reads a range, at any depth of `inner`, and skips everything else.
    fn read(&mut self, meta: &ParseNestedMeta<'_>) -> Result<(), Error> {
        if meta.path.is_ident("range") || meta.path.is_ident("inner") {
            return meta.parse_nested_meta(|inner| self.read(&inner));
        }
        if meta.input.peek(token::Paren) {
            let content;
            syn::parenthesized!(content in meta.input);
            content.parse::<TokenStream>()?;
        } else if meta.input.peek(token::Eq) {
            let value = Some(meta.value()?.parse::<Expr>()?);
            match &meta.path {
                path if path.is_ident("min") => self.min = value,
                path if path.is_ident("max") => self.max = value,
                _ => {}
            }
        }
        Ok(())
    }
}
