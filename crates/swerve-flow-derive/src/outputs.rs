//! `#[derive(Outputs)]`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{DeriveInput, Error};

use crate::fields::{Field, fields};

pub(crate) fn derive(input: &DeriveInput) -> Result<TokenStream, Error> {
    let fields = fields(input)?;
    if let Some(field) = fields.iter().find(|field| field.feedback || field.raw) {
        return Err(Error::new_spanned(field.ident, "`#[port(..)]` is for inputs"));
    }
    let outputs = outputs(input, &fields);
    let named = named(input, &fields);
    Ok(quote! { #outputs #named })
}

/// Implements `Outputs`: the struct as the output of a step.
fn outputs(input: &DeriveInput, fields: &[Field<'_>]) -> TokenStream {
    let struct_name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let idents: Vec<_> = fields.iter().map(|field| field.ident).collect();
    let types: Vec<_> = fields.iter().map(|field| field.ty).collect();
    let names = fields.iter().map(|field| &field.name);
    let indices: Vec<_> = (0..fields.len()).collect();
    quote! {
        #[automatically_derived]
        impl #generics ::swerve_flow::Outputs for #struct_name #arguments #bounds {
            type Streams = (#(<#types as ::swerve_flow::Outputs>::Streams,)*);
            type Values = (#(<#types as ::swerve_flow::Outputs>::Values,)*);

            fn declare(streams: &mut ::swerve_flow::Declaration) -> Self::Streams {
                let _ = &streams;
                (#(<#types as ::swerve_flow::OutputPort>::declare_named(streams, #names),)*)
            }

            fn fresh(first: usize) -> Self {
                let _ = first;
                Self { #(#idents: <#types as ::swerve_flow::Outputs>::fresh(first + #indices),)* }
            }

            #[inline(always)]
            fn take(&mut self, sent: &mut ::swerve_flow::Outs) {
                let _ = &sent;
                #(::swerve_flow::Outputs::take(&mut self.#idents, sent);)*
            }

            fn values(outs: ::core::option::Option<&::swerve_flow::Outs>, first: usize) -> Self::Values {
                let (_, _) = (outs, first);
                (#(<#types as ::swerve_flow::Outputs>::values(outs, first + #indices),)*)
            }
        }
    }
}

/// Implements `NamedOutputs`: the struct as a list of ports.
fn named(input: &DeriveInput, fields: &[Field<'_>]) -> TokenStream {
    let name = &input.ident;
    let (generics, arguments, bounds) = input.generics.split_for_impl();
    let ports = fields.iter().map(|Field { ty, name, doc, .. }| {
        quote! { ::swerve_flow::OutputInfo::new::<#ty>(#name, #doc) }
    });
    quote! {
        #[automatically_derived]
        impl #generics ::swerve_flow::NamedOutputs for #name #arguments #bounds {
            fn ports() -> ::std::vec::Vec<::swerve_flow::OutputInfo> {
                ::std::vec![#(#ports),*]
            }
        }
    }
}
