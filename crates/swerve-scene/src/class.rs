//! Semantic classes of surfaces: the label set of Cityscapes (Cordts et al. 2016), with the ids of its published label
//! table.

/// Declares the labels with id and name.
macro_rules! classes {
    ($($(#[$doc:meta])* $variant:ident = $id:literal, $name:literal;)+) => {
        /// Semantic class of a surface, numbered with the ids of Cityscapes.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
        #[repr(u8)]
        pub enum SemanticClass {
            $($(#[$doc])* $variant = $id,)+
        }

        impl SemanticClass {
            /// All classes, by id.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Class of a Cityscapes id.
            pub fn from_id(id: u8) -> Option<Self> {
                match id {
                    $($id => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// Name in Cityscapes' label table.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }
    };
}

classes! {
    /// Unknown.
    #[default]
    Unlabeled = 0, "unlabeled";
    /// Part of the vehicle that carries the camera.
    EgoVehicle = 1, "ego vehicle";
    /// Stationary objects: bins, boxes, benches.
    Static = 4, "static";
    /// Other moving objects.
    Dynamic = 5, "dynamic";
    /// Other ground.
    Ground = 6, "ground";
    /// Carriageway with its markings.
    Road = 7, "road";
    /// Pavement with its kerb.
    Sidewalk = 8, "sidewalk";
    /// Parking places.
    Parking = 9, "parking";
    /// Rail tracks.
    RailTrack = 10, "rail track";
    /// Houses.
    Building = 11, "building";
    /// Free-standing walls.
    Wall = 12, "wall";
    /// Fences.
    Fence = 13, "fence";
    /// Guard rails.
    GuardRail = 14, "guard rail";
    /// Bridges.
    Bridge = 15, "bridge";
    /// Tunnels.
    Tunnel = 16, "tunnel";
    /// Poles, including those of signs and lights.
    Pole = 17, "pole";
    /// Traffic light heads.
    TrafficLight = 19, "traffic light";
    /// Traffic sign faces.
    TrafficSign = 20, "traffic sign";
    /// Trees, hedges.
    Vegetation = 21, "vegetation";
    /// Grass, soil, sand.
    Terrain = 22, "terrain";
    /// Open sky.
    Sky = 23, "sky";
    /// Pedestrians.
    Person = 24, "person";
    /// Riders of two-wheelers.
    Rider = 25, "rider";
    /// Cars, vans.
    Car = 26, "car";
    /// Trucks.
    Truck = 27, "truck";
    /// Buses.
    Bus = 28, "bus";
    /// Caravans.
    Caravan = 29, "caravan";
    /// Trailers.
    Trailer = 30, "trailer";
    /// Trains, trams.
    Train = 31, "train";
    /// Motorcycles without their rider.
    Motorcycle = 32, "motorcycle";
    /// Bicycles without their rider.
    Bicycle = 33, "bicycle";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_are_those_of_the_table() {
        for &class in SemanticClass::ALL {
            assert_eq!(SemanticClass::from_id(class as u8), Some(class));
        }
        assert_eq!(SemanticClass::from_id(99), None);
        assert_eq!(SemanticClass::Car as u8, 26);
        assert_eq!(SemanticClass::TrafficLight.name(), "traffic light");
    }
}
