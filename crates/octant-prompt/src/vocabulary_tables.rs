//! Prior knowledge of ordinary flats and offices, written by hand as plain text: a line per entry, words normalised and singular.
//!
//! Read once by [`crate::vocabulary`]. Add a word here and every part of the crate knows it.

/// Synonyms; the first word is the canonical one.
pub const SYNONYMS: &str = "\
sofa, couch, settee, loveseat, sectional
tv, television, tv set, television set, telly, tv screen, flat screen tv
monitor, computer monitor, computer screen, screen, display
trash can, trash bin, garbage can, garbage bin, waste bin, wastebasket, waste basket, rubbish bin, trashcan, dustbin, bin, litter bin, trash, \
    wastebin, garbage
recycling bin, recycle bin, recycling can
fridge, refrigerator, icebox
stove, cooker, hob, cooktop, stovetop
oven
microwave, microwave oven
dishwasher, dish washer
sink, washbasin, basin, wash basin, kitchen sink, bathroom sink, lavatory
toilet, commode, loo, toilet bowl
bathtub, tub, bath tub, bath
shower, shower cabin, shower stall
washing machine, washer, clothes washer, laundry machine
dryer, tumble dryer, clothes dryer
mug, coffee mug, tea mug, beer mug
cup, teacup, tea cup, coffee cup, paper cup
glass, drinking glass, water glass, wine glass, tumbler
bottle, water bottle, wine bottle
plate, dish, dinner plate
bowl, fruit bowl
pot, cooking pot, saucepan, stockpot
pan, frying pan, skillet
kettle, electric kettle, tea kettle, teakettle
coffee machine, coffee maker, espresso machine, coffeemaker
toaster
chair
office chair, desk chair, swivel chair, task chair, computer chair, rolling chair
armchair, arm chair, easy chair, lounge chair, recliner, sofa chair
stool, bar stool, barstool
bench
ottoman, footstool, pouf, foot stool, footrest
table
dining table, dinner table, dining room table
coffee table, cocktail table
nightstand, night stand, bedside table, night table, bedside cabinet
end table, side table
desk, work desk, writing desk, office desk, workstation, computer desk
meeting table, conference table, boardroom table
shelf, shelving, shelving unit, shelf unit, rack
bookshelf, bookcase, book shelf, book case, bookrack
wardrobe, closet, armoire, wardrobe closet
dresser, chest of drawers, drawers, drawer, bureau, chest of drawer
cabinet, cupboard
kitchen cabinet, kitchen cupboard
file cabinet, filing cabinet
counter, countertop, kitchen counter, worktop, counter top
bed
pillow, cushion, throw pillow
blanket, duvet, quilt, comforter
curtain, drape, drapes, window curtain
rug, carpet, area rug
doormat, door mat
lamp
table lamp, desk lamp, reading lamp, bedside lamp
floor lamp, standing lamp
light, ceiling light, light fixture, ceiling lamp
plant, potted plant, houseplant, house plant, pot plant, flowerpot, flower pot, indoor plant
picture, painting, poster, picture frame, photo, artwork, framed picture, photograph, wall picture
mirror
clock, wall clock
whiteboard, white board, dry erase board
blackboard, chalkboard, black board
book, paperback, textbook
laptop, laptop computer, notebook computer
computer, computer tower, pc, desktop computer, pc tower
keyboard, computer keyboard
mouse, computer mouse
printer
photocopier, copier, copy machine, copying machine
phone, telephone, smartphone, cell phone, mobile phone, cellphone, desk phone
speaker, loudspeaker
backpack, rucksack, knapsack, back pack, book bag, bookbag
suitcase, luggage, trolley case
bag, handbag, purse
box, cardboard box, carton, package
basket
hamper, laundry basket, laundry hamper
towel, bath towel, hand towel
soap, soap bottle
soap dispenser
toilet paper, toilet roll, toilet tissue
paper towel dispenser
umbrella
umbrella stand
coat rack, coat stand, hat stand, coat hanger, clothes rack
shoe, sneaker, boot
shoe rack, shoe shelf
bicycle, bike
vase, flower vase
candle
remote, remote control, tv remote
guitar
piano
fan, electric fan
radiator, heater
air conditioner, ac, air conditioning unit
fire extinguisher, extinguisher
water cooler, water dispenser, water fountain
vending machine, snack machine
projector, beamer
projector screen, projection screen
cart, trolley
ladder, stepladder, step ladder
toolbox, tool box, tool chest
broom
mop
bucket, pail
iron, clothes iron
ironing board
vacuum cleaner, vacuum, hoover
game console, console, gaming console
teddy bear, stuffed animal, plush toy, soft toy, stuffed toy
toy
magazine
newspaper
notebook, notepad
pen, pencil
jacket, coat
person, human, man, woman, child
stairs, staircase, stair, stairway
server rack, server cabinet, server
workbench, work bench
tv stand, tv table, media console, tv cabinet
crib, baby bed, cot
scale, bathroom scale
cutting board, chopping board
knife
door
window
fruit, apple, banana, orange fruit
kitchen table, breakfast table
alarm clock
sideboard, credenza, buffet
storage rack, storage shelf, metal rack
paper stack, paper
reception desk, front desk
console table, hall table
shoe cabinet
lab bench
microscope
";

/// Classes that a camera confuses.
pub const LOOK_ALIKES: &str = "\
mug, cup, glass
desk, table, dining table, meeting table, workbench, kitchen table, console table, reception desk, lab bench, counter
coffee table, end table, nightstand, ottoman, table
sofa, armchair
chair, armchair, office chair, stool
shelf, bookshelf, storage rack
cabinet, kitchen cabinet, file cabinet, dresser, wardrobe, shelf, counter, sideboard, shoe cabinet
dresser, nightstand
tv, monitor, projector screen
backpack, bag, suitcase
box, basket, hamper
trash can, recycling bin, bucket, hamper
whiteboard, projector screen, blackboard, picture
plant, vase
bottle, vase, soap
stove, oven
washing machine, dishwasher, dryer
printer, photocopier, microwave
microwave, oven, toaster
book, magazine, notebook, laptop
lamp, floor lamp, table lamp, light
plate, bowl
pot, pan, kettle
towel, blanket
rug, doormat
mirror, picture, window
bench, stool, ottoman
toilet, bathtub
kettle, coffee machine
phone, remote
keyboard, laptop
cabinet, fridge
broom, mop
clock, alarm clock
sideboard, tv stand, console table
";

/// What stands where the first thing is: the next best thing to look at when no known object bears its name.
pub const STAND_INS: &str = "\
window, windowsill, window sill, blinds, blind, curtain, shade, shutter
door, doorframe, door frame, doorway, entrance, front entrance, entry, exit, gate, closet door, shower door
doorway, door, doorframe
entrance, door, doorframe
exit, door, doorframe
sink, bathroom vanity, bathroom counter, faucet, counter, kitchen counter
vanity, bathroom vanity, sink, bathroom counter
shower, shower curtain, shower wall, shower door, shower head, bathtub, shower floor
bathtub, shower curtain, shower
stove, range hood, oven, stove hood
oven, stove, range hood
hood, range hood
closet, closet door, closet wall, clothes, wardrobe, closet rod, closet floor
wardrobe, closet, closet door, clothes
bed, headboard, mattress, bunk bed, pillow, blanket
headboard, bed
foot, bed
computer, computer tower, monitor, keyboard, laptop, desk
monitor, computer, laptop, tv
screen, monitor, projector screen, tv
tv, tv stand, monitor, entertainment center
television, tv stand
desk, table, counter, monitor
table, desk, counter, coffee table, dining table
shelf, rack, bookshelf, cabinet, books
bookshelf, shelf, book
counter, kitchen counter, bathroom counter, bar, kitchen island, kitchen cabinet, cabinet, sink
bar, counter, kitchen counter, kitchen island
island, kitchen island, kitchen counter
dresser, cabinet, drawer, nightstand
drawer, dresser, cabinet, file cabinet
cabinet, kitchen cabinet, wardrobe, counter
stall, bathroom stall, bathroom stall door
sofa, armchair, bench
couch, sofa chair, armchair, seat
armchair, sofa chair, sofa, chair, seat
seat, chair, sofa, armchair, bench
whiteboard, board, blackboard, bulletin board
blackboard, whiteboard, board
board, whiteboard, blackboard, bulletin board
coffee machine, coffee maker, kitchen counter
machine, copier, printer, vending machine, washing machine, coffee maker
copier, printer
printer, copier
trash can, recycling bin, trash bin, container
stairs, stair rail, rail, railing, banister
lamp, light, nightstand
light, lamp
plant, potted plant, plants, flower
picture, poster, board, decoration, mirror
toilet, toilet paper, toilet seat cover dispenser
fridge, mini fridge
radiator, heater
heater, radiator
paper, paper bag, papers, folder, book
towel, towel rack, rail, bar
coat, jacket, clothes, coat rack, hat
clothes, clothing, jacket, shirt
shoe, shoes, slippers
wall, bulletin board, column, pillar
column, pillar
pillar, column
mirror, bathroom mirror, sink
person, people
";

/// Functional groups and their classes.
pub const GROUPS: &str = "\
seating: chair, office chair, armchair, stool, bench, sofa, ottoman
work: table, desk, meeting table, coffee table, dining table, end table, workbench, counter, computer, laptop, keyboard, mouse, printer, photocopier, \
    phone, pen, notebook, kitchen table, console table, reception desk, lab bench, microscope, paper stack
storage: cabinet, kitchen cabinet, file cabinet, shelf, bookshelf, wardrobe, dresser, box, basket, hamper, cart, suitcase, backpack, bag, shoe rack, \
    coat rack, toolbox, server rack, tv stand, book, sideboard, storage rack, shoe cabinet
display: tv, monitor, projector, projector screen, whiteboard, blackboard, picture, mirror, clock, alarm clock
sleep: bed, pillow, blanket, nightstand, crib
kitchen: fridge, stove, oven, microwave, dishwasher, mug, cup, glass, bottle, plate, bowl, pot, pan, kettle, coffee machine, toaster, water cooler, \
    vending machine, cutting board, knife, fruit
wash: sink, toilet, bathtub, shower, towel, soap, soap dispenser, toilet paper, washing machine, dryer, scale, iron, ironing board
light: lamp, table lamp, floor lamp, light, candle, window, curtain
decor: plant, vase, rug, doormat, piano, guitar, teddy bear, toy
clean: trash can, recycling bin, broom, mop, bucket, vacuum cleaner
";

/// Things that are seen from across a room.
pub const LARGE_OR_FIXED: &str = "\
armchair, bathtub, bed, bench, bicycle, blackboard, bookshelf, cabinet, chair, coat rack, console table, counter, crib, curtain, desk, dishwasher, \
    door, dresser, dryer, floor lamp, fridge, lab bench, nightstand, oven, photocopier, piano, plant, reception desk, rug, server rack, shelf, shower, \
    sideboard, sink, sofa, stairs, stool, storage rack, stove, table, toilet, tv, tv stand, vending machine, wardrobe, washing machine, whiteboard, \
    window, workbench
";

/// Room kinds: `kind | other names | contents, the most telling first`.
pub const ROOMS: &str = "\
kitchen | kitchen, kitchenette, galley, pantry kitchen, tea kitchen | stove, oven, fridge, dishwasher, counter, kitchen cabinet, microwave, kettle, \
    toaster, sink, pot, pan, plate, bowl, mug, cup, coffee machine, glass, cutting board, bottle, knife, dining table, fruit, trash can, cabinet, stool, \
    chair, table, kitchen table
living room | living room, lounge, sitting room, family room, livingroom, parlor, parlour, living area | sofa, tv, coffee table, tv stand, armchair, \
    remote, rug, game console, speaker, floor lamp, bookshelf, piano, guitar, pillow, ottoman, plant, vase, picture, magazine, book, blanket, \
    candle, end table, lamp, mug
bedroom | bedroom, master bedroom, guest room, guest bedroom, sleeping room | bed, nightstand, wardrobe, pillow, blanket, dresser, table lamp, teddy \
    bear, alarm clock, mirror, lamp, rug, curtain, book, phone, picture, suitcase, armchair, laptop
bathroom | bathroom, washroom, restroom, wc, toilet room, shower room, rest room, mens room, ladies room, bath room | toilet, shower, bathtub, toilet \
    paper, towel, soap, soap dispenser, sink, mirror, scale, hamper, washing machine, cabinet, trash can
office | office, study, workroom, home office, open office, work room, study room | desk, office chair, computer, keyboard, mouse, monitor, laptop, \
    printer, file cabinet, phone, bookshelf, notebook, pen, table lamp, backpack, book, trash can, whiteboard, lamp, mug, plant, cabinet, clock
meeting room | meeting room, conference room, boardroom, board room, seminar room, classroom, meetingroom | meeting table, projector, projector \
    screen, whiteboard, tv, office chair, chair, phone, laptop, plant, clock, bottle, table, monitor, cup, glass, notebook, picture
dining room | dining room, dining area, dinner room, diningroom | dining table, sideboard, chair, candle, cabinet, vase, plate, glass, table, bowl, \
    picture, rug, plant, bottle, light
corridor | corridor, hallway, hall, passage, entrance, entry, entryway, foyer, vestibule, passageway, entrance hall, stairwell, landing | coat rack, \
    shoe rack, umbrella stand, doormat, shoe cabinet, console table, shoe, fire extinguisher, umbrella, jacket, bench, water cooler, picture, mirror, \
    clock, rug, plant, stairs
storage | storage, storage room, storeroom, pantry, utility room, supply room, store room, storage closet, closet room, supply closet, garage, \
    workshop, basement | storage rack, ladder, broom, mop, bucket, toolbox, vacuum cleaner, box, cart, shelf, bicycle, suitcase, basket, fan, cabinet, \
    hamper, ironing board
laundry room | laundry room, laundry, wash room | washing machine, dryer, ironing board, iron, hamper, basket, towel, sink, shelf, bucket, mop
break room | break room, canteen, cafeteria, staff room, coffee corner, coffee room, tea room, lunch room, breakroom | vending machine, coffee \
    machine, water cooler, microwave, fridge, mug, cup, sink, sofa, table, kettle, chair, stool, counter, trash can, plate, bottle, plant, magazine
print room | print room, copy room, printer room, copier room, mail room | photocopier, printer, paper stack, recycling bin, newspaper, shelf, box, \
    cabinet, counter, trash can
server room | server room, machine room, data room | server rack, air conditioner, computer, fire extinguisher, cabinet, monitor, keyboard
lab | lab, laboratory, iot lab, iot laboratory | microscope, lab bench, workbench, computer, monitor, stool, shelf, toolbox, cabinet, keyboard, \
    laptop, sink, fire extinguisher, box, desk, fan
lobby | lobby, reception, waiting room, waiting area, reception area | reception desk, magazine, sofa, armchair, plant, water cooler, coffee table, \
    newspaper, umbrella stand, counter, clock, picture, bench, rug, vase
library | library, reading room | bookshelf, book, armchair, magazine, desk, table lamp, floor lamp, ladder, newspaper, table, rug
nursery | nursery, childrens room, kids room, child room, playroom, kid room | crib, teddy bear, toy, bed, rug, desk, book, dresser, box, lamp
";

/// Colour words with reference colours (sRGB, 0-255).
pub const COLORS: &str = "\
red 190 40 40
green 60 140 70
blue 50 90 180
yellow 220 200 60
orange 230 130 40
brown 120 80 50
black 30 30 32
white 235 235 232
gray 130 130 130
grey 130 130 130
silver 180 182 186
pink 230 150 170
purple 120 60 140
violet 120 60 140
beige 215 200 170
cream 235 225 200
tan 200 170 125
turquoise 60 180 175
teal 30 125 125
golden 200 165 70
gold 200 165 70
maroon 110 35 40
navy 35 45 95
dark 45 42 40
ivory 235 230 210
lavender 180 160 200
";

/// Materials; the first word is the canonical one.
pub const MATERIALS: &str = "\
wood, wooden, oak, pine, bamboo
metal, metallic, steel, iron, aluminium, aluminum
plastic
leather
fabric, cloth, textile, wool, cotton, velvet
ceramic, porcelain
stone, marble, granite
paper, cardboard
rubber
wicker, rattan
glass, glassy
";
