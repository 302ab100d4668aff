//! Points as text, one per line. A first pass over the whole file finds out how it is laid out and what it holds; then its chunks
//! are decoded independently.

pub(crate) mod axis_values;
pub(crate) mod column_list;
pub(crate) mod columns;
pub(crate) mod comment_names;
pub(crate) mod commented_header;
pub(crate) mod cut_off;
pub(crate) mod decimal_comma;
pub(crate) mod decimal_sign;
pub(crate) mod degrees;
pub(crate) mod delimiter;
pub(crate) mod granularity;
pub(crate) mod header;
pub(crate) mod layout;
pub(crate) mod lines;
pub(crate) mod lines_between;
pub(crate) mod name;
pub(crate) mod names;
pub(crate) mod nodata_rows;
pub(crate) mod noise;
pub(crate) mod noise_warning;
pub(crate) mod number;
pub(crate) mod numbered;
pub(crate) mod optional_columns;
pub(crate) mod options;
pub(crate) mod outliers;
pub(crate) mod role;
pub(crate) mod row;
pub(crate) mod row_box;
pub(crate) mod row_choice;
pub(crate) mod stated_count;
pub(crate) mod survey;
pub(crate) mod table;
pub(crate) mod thousands;
pub(crate) mod units;
